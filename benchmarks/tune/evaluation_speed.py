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

"""Run time of evaluating an hour, against copying it and comparing it with a threshold.

Both sides read the same npz file, not compressed and in the page cache, in turns. The plain
pass reads the array with ``numpy.load``, copies it and compares it with a number. The evaluation
is that of ``slip_evaluate``, from the file to the figures.

:func:`measure_evaluation` gives one object:

``rows``, ``channels``, ``rounds``
    Size of the recording, and how often each side ran.
``evaluation_s``, ``plain_s``
    Shortest time of the evaluation and of the plain pass.
``ratio``
    ``evaluation_s`` divided by ``plain_s``.
``times_real_time``
    How many times faster than real time the evaluation is.
``figures``
    Some results of the evaluation: ``slips``, ``recall``, ``latency_median_ms``, ``auc_all``.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import least_times_s
from slip_detector.evaluation.evaluator import RecordingLoader, evaluate_recording
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.protocol import SCENES, simulate_trials
from slip_detector.parameters.detector import ChainConfig

ROUNDS = 5

#: An hour at the chain's 380 Hz.
HOUR_ROWS = 3600 * 380


def write_trials(path: Path, rows: int = HOUR_ROWS) -> None:
    """Write trials of the paper's protocol, one after the other, as a labelled recording.

    Parameters
    ----------
    path
        The npz file.
    rows
        Number of rows; the last trial is cut there.
    """
    trials = [trial for plate in SCENES.values() for trial in simulate_trials(plate, range(2))]
    volts = np.concatenate([trial.volts for trial in trials])
    slip = np.concatenate([trial.moving for trial in trials])
    repeats = -(-rows // len(volts))
    np.savez(
        path,
        volts=np.tile(volts, (repeats, 1))[:rows],
        slip=np.tile(slip, repeats)[:rows],
        sample_rate_hz=ChainConfig().sample_rate_hz,
    )


def measure_evaluation(rows: int = HOUR_ROWS, rounds: int = ROUNDS) -> dict[str, Any]:
    """Measure the evaluation against a plain pass; the keys are in the module's docstring.

    Parameters
    ----------
    rows
        Number of rows of 16 channels.
    rounds
        How often the sides take turns.
    """
    config = ChainConfig()
    loader = RecordingLoader(config)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'hour.npz'
        write_trials(path, rows)
        figures = figures_of_merit([evaluate_recording(loader, path).outcome])

        def evaluation() -> None:
            figures_of_merit([evaluate_recording(loader, path).outcome])

        def plain() -> None:
            with np.load(path) as file:
                _ = file['volts'].copy() > 4.5

        times_s = least_times_s([evaluation, plain], rounds)
    return {
        'rows': rows,
        'channels': config.channels,
        'rounds': rounds,
        'evaluation_s': times_s[0],
        'plain_s': times_s[1],
        'ratio': times_s[0] / times_s[1],
        'times_real_time': rows / config.sample_rate_hz / times_s[0],
        'figures': {
            name: figures[name] for name in ('slips', 'recall', 'latency_median_ms', 'auc_all')
        },
    }
