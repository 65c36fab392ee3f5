# Copyright 2026 The slip_detector maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The objective of a search in other processes, which read the recordings themselves."""

import dataclasses
import threading
from typing import Any

from slip_detector.tuning.loading import TrainingFiles
from slip_detector.tuning.objective import Candidate, Objective
from slip_detector.tuning.problem import Problem

#: The last objective of this process and the name of its problem, for the next trial.
_last: tuple[str, tuple[Problem, Objective] | None] = ('', None)

#: A worker of a cluster may call from several threads; an objective works for one at a time.
_one_at_a_time = threading.Lock()


class FileObjective:
    """The objective of a problem whose recordings are read by the process that needs them.

    It has a few kilobytes when it is sent to another process, as it contains no rows.

    Parameters
    ----------
    files
        The recordings, whose paths must be the same for every process.
    problem
        The problem, with the tracks that were read from these files.
    """

    def __init__(self, files: TrainingFiles, problem: Problem) -> None:
        self._files, self._name = files, problem.study_name()
        self._problem = dataclasses.replace(problem, tracks=[])

    def candidates(self, point: dict[str, Any]) -> list[Candidate]:
        """Return the candidates at a point; see :meth:`.problem.Problem.candidates_at`.

        Raises
        ------
        ValueError
            When the recordings cannot be read or are not those of the problem.
        """
        with _one_at_a_time:
            problem, objective = self._loaded()
            return problem.candidates_at(objective, point)

    def _loaded(self) -> tuple[Problem, Objective]:
        global _last  # noqa: PLW0603
        name, loaded = _last
        if loaded is None or name != self._name:
            _last = ('', None)  # there may not be enough memory for two
            problem = dataclasses.replace(self._problem, tracks=self._files.load()[0])
            if problem.study_name() != self._name:
                raise ValueError(
                    f'{", ".join(self._files.paths)}: a worker finds other recordings there, '
                    'allowed: paths that are the same for all workers'
                )
            loaded = problem, problem.objective()
            _last = (self._name, loaded)
        return loaded
