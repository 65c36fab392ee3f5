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

"""Scenes, repeated, with noise: an hour is evaluated and read from MCAP; a search."""

import tempfile
import time
import timeit
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.chain.rivals import NumpyChain
from benchmarks.measurement import least_times_s
from slip_detector.chain.samples import Samples
from slip_detector.evaluation.evaluator import RecordingLoader, evaluate_recording
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.parameters import ChainConfig, DetectorConfig
from slip_detector.recordings import open_recording, write_recording
from slip_detector.scenes import find_scene, load_scene
from slip_detector.tuning.problem import Problem
from slip_detector.tuning.search import Study, search
from slip_detector.tuning.tracks import track_of

RATE_HZ, HOUR_S = 380.0, 3600.0

SCENES = ('plate_400um', 'taps', 'tremor_hum', 'rolling')

#: Noise that is added to each sample: repetitions without noise would compress too well.
NOISE_V = 5e-4


def scenes_with_noise(duration_s: float) -> Iterator[Samples]:
    """Yield the scenes, repeated and with noise, until they last this long."""
    random = np.random.default_rng(0)
    scenes = [load_scene(find_scene(name), np.random.default_rng(0)) for name in SCENES]
    parts = [scene.read(scene.length) for scene in scenes]
    done, rows = 0, round(duration_s * RATE_HZ)
    while done < rows:
        for part in parts:
            volts = part.volts[: rows - done]
            volts = volts + NOISE_V * random.standard_normal(volts.shape)
            stamps_ns = np.rint((done + np.arange(len(volts))) * 1e9 / RATE_HZ).astype(np.int64)
            assert part.truth is not None
            if len(volts):
                yield Samples(volts, stamps_ns, np.asarray(part.truth[: len(volts)], np.bool_))
            done += len(volts)


def write_hour(path: Path, duration_s: float) -> None:
    """Write the hour, or another duration, as a labelled recording."""
    write_recording(path, scenes_with_noise(duration_s), RATE_HZ, DetectorConfig().names)


def measure_evaluation(duration_s: float = HOUR_S, rounds: int = 5) -> dict[str, Any]:
    """Measure ``slip_evaluate``, from an npz to the figures, against a plain pass, in turns.

    The plain pass reads the array, copies it and compares it with a number. The file is not
    compressed and in the page cache. The result has the shortest time, ``evaluation_s``, and
    its ``ratio`` to that of the plain pass.
    """
    loader = RecordingLoader(ChainConfig())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'hour.npz'
        write_hour(path, duration_s)

        def evaluation() -> None:
            figures_of_merit([evaluate_recording(loader, path).outcome])

        def plain() -> None:
            with np.load(path) as file:
                _ = file['volts'].copy() > 4.5

        evaluation_s, plain_s = least_times_s([evaluation, plain], rounds)
    return {'evaluation_s': evaluation_s, 'ratio': evaluation_s / plain_s}


def measure_reading(duration_s: float = HOUR_S) -> dict[str, Any]:
    """Read a bag once, a message a sample; ``times_real_time`` is how much faster that is."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'hour.mcap'
        write_hour(path, duration_s)
        start_s = time.perf_counter()
        rows = sum(len(piece.volts) for piece in open_recording(path).pieces(RATE_HZ))
        read_s = time.perf_counter() - start_s
    return {'read_s': read_s, 'times_real_time': rows / RATE_HZ / read_s}


def measure_search(trials: int = 100, minutes: float = 15.0) -> dict[str, Any]:
    """Measure a search of some trials on a recording of some minutes.

    Each trial designs a chain, runs it, and finds the best threshold of each vote and its areas
    under the ROC curve. The result has ``ns_per_row_and_trial``, ``numpy_ns_per_row`` of the given
    chain alone in SciPy and NumPy, without any of that but the run, and their ``ratio``.
    """
    given = ChainConfig()
    track = track_of('scenes', list(scenes_with_noise(60.0 * minutes)), RATE_HZ)
    problem, plain = Problem([track]), NumpyChain(given, track.volts[0])
    problem.best(given)  # Compile and load before the measurement.
    study = Study(problem, seed=0)
    (plain_s,) = least_times_s([lambda: plain.update(track.volts)], 3, time.process_time)
    timer = timeit.Timer(lambda: search(study, trials), timer=time.process_time)
    trial_s = timer.timeit(1) / trials
    rows = len(track.volts)
    return {
        'ns_per_row_and_trial': trial_s / rows * 1e9,
        'numpy_ns_per_row': plain_s / rows * 1e9,
        'ratio': trial_s / plain_s,
    }
