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

"""Better parameters of a detector, learnt and searched from labelled recordings.

Recordings are :mod:`.tracks` in memory. Three subjects follow. Learning: :mod:`.measuring`,
:mod:`.labels`, :mod:`.learning`. Scoring a chain: :mod:`.sweep`, :mod:`.problem`.
Search and decision: :mod:`.space`, :mod:`.search`, :mod:`.verdict`.
"""

from slip_detector.tuning.learning import learn_from_quiet
from slip_detector.tuning.problem import beats_chance, searched_parameters, worse_figures
from slip_detector.tuning.tracks import Track, TrainingFiles, hold_out, load_tracks, track_of
from slip_detector.tuning.verdict import TuningParameters, tune

__all__ = [
    'Track', 'TrainingFiles', 'TuningParameters', 'beats_chance', 'hold_out',
    'learn_from_quiet', 'load_tracks', 'searched_parameters', 'track_of', 'tune', 'worse_figures',
]  # fmt: skip
