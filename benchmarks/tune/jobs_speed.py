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

"""How many hours of recordings are evaluated in a second, by format and number of jobs.

:func:`measure_jobs` gives one object:

``recordings``, ``minutes``, ``channels``, ``sample_rate_hz``
    Number of recordings of each format, and length, channels and rate of each.
``npz``, ``mcap``
    For each format: ``bytes_per_hour`` on disk; ``hours_per_s`` by number of jobs, from the files
    to the figures, in the fastest round; and ``processor_s_per_hour``, which hardly depends on
    other load of the machine.
``memory_mib``
    The largest memory of a worker process.
``same``
    Whether all numbers of jobs gave the same figures.
"""

import resource
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.tune.reading_speed import CHANNELS, RATE_HZ, write_labelled_noise
from slip_detector.commands.evaluate import as_report, evaluate
from slip_detector.commands.workers import Workers
from slip_detector.evaluation.evaluator import RecordingLoader

FORMATS = ('npz', 'mcap')

JOBS = (1, 2)

#: Number of recordings of each format, and the minutes of each.
RECORDINGS, MINUTES = 4, 15.0

ROUNDS = 2

#: The shortest time of a round, this process's processor time, and the figures.
Measured = tuple[float, float, dict[str, Any]]


def measure_jobs(
    recordings: int = RECORDINGS,
    minutes: float = MINUTES,
    rounds: int = ROUNDS,
) -> dict[str, Any]:
    """Evaluate the same recordings with different numbers of jobs.

    Parameters
    ----------
    recordings
        Number of recordings of each format.
    minutes
        Length of each.
    rounds
        How often they are evaluated with each number of jobs. A round before these is not counted:
        in it the processes start and the files get into the page cache.
    """
    result: dict[str, Any] = {
        'recordings': recordings,
        'minutes': minutes,
        'channels': CHANNELS,
        'sample_rate_hz': RATE_HZ,
        'same': True,
    }
    hours = recordings * minutes / 60.0
    with tempfile.TemporaryDirectory() as parent:
        folders = {ending: Path(parent) / ending for ending in FORMATS}
        for ending, folder in folders.items():
            folder.mkdir()
            for k in range(recordings):
                write_labelled_noise(folder / f'{k}.{ending}', 60.0 * minutes)
        on_disk = {
            ending: sum(path.stat().st_size for path in folder.iterdir())
            for ending, folder in folders.items()
        }
        by_format: dict[str, list[Measured]] = {ending: [] for ending in FORMATS}
        for number in JOBS:
            with Workers(number) as workers:
                for ending, folder in folders.items():
                    by_format[ending].append(_evaluate(str(folder), workers, rounds))
    for ending, measured in by_format.items():
        result[ending] = {
            'bytes_per_hour': on_disk[ending] / hours,
            'hours_per_s': {
                str(number): hours / least_s
                for number, (least_s, _, _) in zip(JOBS, measured, strict=True)
            },
            'processor_s_per_hour': measured[0][1] / rounds / hours,
        }
        result['same'] &= all(report == measured[0][2] for _, _, report in measured)
    result['memory_mib'] = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0
    return result


def _evaluate(folder: str, workers: Workers, rounds: int) -> Measured:
    """Evaluate the recordings of a folder for some rounds."""
    loader = RecordingLoader()
    least_s, processor_s = float('inf'), 0.0
    evaluate([folder], loader, workers)
    for _ in range(rounds):
        start_s, processor_start_s = time.perf_counter(), time.process_time()
        sets, _ = evaluate([folder], loader, workers)
        least_s = min(least_s, time.perf_counter() - start_s)
        processor_s += time.process_time() - processor_start_s
    return least_s, processor_s, as_report(sets)
