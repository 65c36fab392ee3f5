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

"""Small labelled recordings for the tests of the tuner."""

import dataclasses

import numpy as np
import optuna

from slip_detector.chain.samples import Samples
from slip_detector.commands.tune import main
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.problem import Problem
from slip_detector.tuning.search import Study, search
from slip_detector.tuning.tracks import track_of

RATE_HZ = 380.0

#: Starts ``slip_tune`` as the console script does.
SLIP_TUNE = 'import sys; from slip_detector.commands.command_line import tune; sys.exit(tune())'

#: Four channels, so that a trial takes milliseconds.
#: Its decision takes longer than it needs to.
CHAIN = ChainConfig(
    channels=4,
    groups={'tip': (1, 2), 'pad': (3, 4)},
    gain=1.0,
    threshold=0.05,
    decision_window_s=0.15,
)

HIGH = {'passband_hz': (60.0, 0.0), 'passband_degree': 2, 'stopbands_hz': (), 'exponent': 1}
FLOOR = {'decision': 'evidence', 'noise_floor': (0.01,), 'threshold': 0.1}
EVIDENCE = dataclasses.replace(CHAIN, **HIGH, **FLOOR, vote=1)

PARAMETERS = """# The given ones.
/**/slip_detector:
  ros__parameters:
    channels: 4
    groups: {tip: [1, 2], pad: [3, 4]}
    gain: 1.0
    threshold: 0.05
    decision_window_s: 0.15
    heartbeat_hz: 20.0
/**/slip_driver:
  ros__parameters: {recording_truth_key: label}
/**/slip_evaluate:
  ros__parameters: {tail_s: 0.15}
/**/other_node:
  ros__parameters: {answer: 42}
"""


def slips(seed, duration_s=12.0, slip_hz=18.0, slips=True, noise_v=0.05):
    """Noise, and every 3 s a slip of 0.7 s at a frequency; returns volts and labels."""
    random = np.random.default_rng(seed)
    n = round(duration_s * RATE_HZ)
    time_s = np.arange(n) / RATE_HZ
    truth = (time_s % 3.0 > 1.5) & (time_s % 3.0 < 2.2) & slips
    volts = 4.3 + noise_v * random.standard_normal((n, 4))
    phases = random.uniform(0, 2 * np.pi, 4)
    volts += truth[:, None] * np.sin(2 * np.pi * slip_hz * time_s[:, None] + phases)
    return volts, truth


def track_with(volts, truth=None, name='a', rate_hz=RATE_HZ, kind=''):
    """Return rows of volts as a track; without a truth nothing in them slips."""
    truth = np.zeros(len(volts), bool) if truth is None else truth
    return track_of(name, [Samples.evenly(volts, rate_hz, truth, kind=kind)], rate_hz)


def track(seed, kind='', duration_s=12.0, **what):
    """Return the noise and slips of a seed as a track; one of a kind has no slips."""
    volts, truth = slips(seed, duration_s, **{'slips': not kind, **what})
    return track_with(volts, truth, f'seed {seed}', kind=kind)


def write(path, seed, label=True, **what):
    """Write a recording as npz and return its path as text."""
    volts, truth = slips(seed, **what)
    np.savez(path, volts=volts, sample_rate_hz=RATE_HZ, **({'label': truth} if label else {}))
    return str(path)


def run(*words, code=0):
    """Run ``slip_tune``, and check its exit code."""
    assert main([str(word) for word in words]) == code


def problem(tracks, given_chain=CHAIN):
    before = Problem(tracks).evaluate(given_chain)
    return Problem(tracks, given_chain, before.figures)


def study_of(asked, trials):
    """Search, and return the study in memory."""
    study = Study(asked, seed=1)
    search(study, trials)
    return study


def trials_of(storage):
    """Return the trials of the one study of a storage."""
    (name,) = optuna.get_all_study_names(storage)
    return optuna.load_study(study_name=name, storage=storage).get_trials(deepcopy=False)


def journal(path):
    """Open a journal as a storage."""
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    return JournalStorage(JournalFileBackend(str(path)))
