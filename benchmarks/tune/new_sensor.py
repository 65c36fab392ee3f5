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

"""Run time of the three commands that make a configuration for a new sensor.

:func:`measure_new_sensor` gives an object: ``recording_s``, the length of all recordings;
``quiet_s``, ``taps_s`` and ``search_s``, the time of each command, and ``total_s``; ``taps_told``,
whether knocks could be told from slips; and the figures of :data:`.families.FIGURES` on scenes
with seeds that were not recorded, ``given`` (with learnt noise floors) and ``tuned``.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from benchmarks.tune.families import PLATES, figures_on, play_scenes
from slip_detector.evaluation.scores import SLIP
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.files import read_yaml
from slip_detector.scenes import Scene, find_scene

#: Seeds of the slips that are recorded, and of those that the result is judged on.
RECORDED, JUDGED_ON = range(6200, 6210), range(6300, 6303)

#: Length of the recordings at rest and of knocks, and the time between two knocks.
REST_S, KNOCKS_S, BETWEEN_KNOCKS_S = 152.0, 160.0, 2.0

#: The first configuration: evidence, with a noise floor below that of any sensor.
GIVEN = {
    'decision': 'evidence', 'noise_floor': [1e-9], 'gain': 1.0, 'exponent': 1, 'vote': 2,
}  # fmt: skip

#: The processes of the search.
JOBS = 2


def measure_new_sensor(
    trials: int = 200,
    recorded: Sequence[int] = RECORDED,
    rest_s: float = REST_S,
    knocks_s: float = KNOCKS_S,
) -> dict[str, Any]:
    """Record a simulated sensor and tune it; the keys are in the module's docstring.

    Parameters
    ----------
    trials
        Number of trials of the search.
    recorded
        Seeds of the slips, on each of the paper's plates.
    rest_s, knocks_s
        Length of the recordings at rest and of knocks.
    """
    trembling = {part: read_yaml(find_scene('tremor_hum'))[part] for part in ('tremor', 'hum')}
    plates = [{**read_yaml(find_scene(name)), **trembling} for name in PLATES]
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        (folder / 'slips').mkdir()
        slips = play_scenes(plates, recorded)
        for k, track in enumerate(slips):
            np.savez(
                folder / 'slips' / f'{k}.npz',
                volts=track.volts,
                slip=track.kinds == SLIP,
                sample_rate_hz=track.sample_rate_hz,
            )
        times_s = np.arange(3.0, knocks_s, BETWEEN_KNOCKS_S).tolist()
        taps = {**read_yaml(find_scene('taps'))['taps'], 'times_s': times_s}
        _write_held(folder / 'rest.npz', rest_s, trembling)
        _write_held(folder / 'knocks.npz', knocks_s, {**trembling, 'taps': taps})
        (folder / 'given.yaml').write_text(
            yaml.safe_dump({'/**/slip_detector': {'ros__parameters': GIVEN}})
        )
        quiet_s, _ = _slip_tune(folder, 'given', 'quiet', '--quiet', 'rest.npz')
        taps_s, told = _slip_tune(folder, 'quiet', 'taps', 'slips', '--taps', 'knocks.npz')
        words = ['slips', 'rest.npz', 'knocks.npz', '--jobs', str(JOBS), '--trials', str(trials)]
        search_s, _ = _slip_tune(folder, 'taps' if told else 'quiet', 'tuned', *words)
        quiet, tuned = (
            ChainConfig.from_yaml(folder / f'{name}.yaml') for name in ('quiet', 'tuned')
        )
    judged = play_scenes(plates, JUDGED_ON)
    return {
        'recording_s': sum(track.duration_s for track in slips) + rest_s + knocks_s,
        'quiet_s': quiet_s,
        'taps_s': taps_s,
        'search_s': search_s,
        'total_s': quiet_s + taps_s + search_s,
        'taps_told': told,
        'given': figures_on(judged, quiet),
        'tuned': figures_on(judged, tuned),
    }


def _write_held(path: Path, duration_s: float, parts: Mapping[str, Any]) -> None:
    """Record a plate that is held and does not slide."""
    plate = read_yaml(find_scene('tremor_hum'))
    steps = [{'duration_s': 1}, {'duration_s': 1, 'force_n': 0.4}, {'duration_s': duration_s - 2}]
    held = {name: plate[name] for name in ('friction', 'texture')}
    scene = Scene({**held, 'steps': steps, **parts}, np.random.default_rng(0))
    samples = scene.read(round(duration_s * scene.sample_rate_hz))
    rest = np.zeros(len(samples.volts), bool)
    np.savez(path, sample_rate_hz=scene.sample_rate_hz, volts=samples.volts, slip=rest)


def _slip_tune(folder: Path, before: str, after: str, *words: str) -> tuple[float, bool]:
    """Run ``slip_tune`` from one parameter file to the next; return its time and its success."""
    begun_s = time.perf_counter()
    command = [sys.executable, '-m', 'slip_detector.commands.tune', *words]
    command += ['--config', f'{before}.yaml', '--out', f'{after}.yaml']
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode and '--taps' not in words:
        raise RuntimeError(f'slip_tune ended with {done.returncode}: {done.stderr}')
    return time.perf_counter() - begun_s, done.returncode == 0
