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


"""Scenes and recordings to tune with: a hand that trembles beside a mains cable."""

import functools

import numpy as np

from slip_detector.chain.samples import Samples
from slip_detector.parameters.yaml_files import read_yaml
from slip_detector.recordings.labels import BY_HAND_S
from slip_detector.recordings.writing import BagWriter
from slip_detector.scenes import Scene, find_scene

RATE_HZ = 380.0

HAND = {name: read_yaml(find_scene('tremor_hum'))[name] for name in ('tremor', 'hum')}

#: Seconds of a scene before the object is gripped.
BEGIN_S = 2.0


def gripped(duration_s):
    """An object at rest in the grip, after two seconds in which it is gripped."""
    steps = [{'duration_s': 1.0}, {'duration_s': 1.0, 'force_n': 0.4}, {'duration_s': duration_s}]
    texture = {'spatial_period_m': 400.0e-6}
    return {'steps': steps, 'friction': {'model': 'lugre'}, 'texture': texture, **HAND}


def slipping():
    """A plate that slides once, after two seconds at rest."""
    return {**read_yaml(find_scene('plate_400um')), **HAND}


def samples(description, duration_s, seed):
    """Rows of a scene, with the truth."""
    return Scene(description, np.random.default_rng(seed)).read(round(duration_s * RATE_HZ))


#: A knock every two seconds.
TAPS = {'times_s': np.arange(3.0, 14.0, 2.0).tolist(), 'peak_force_n': 0.5, 'duration_s': 0.01}

#: Recordings in the order of their seeds: a scene, and how long it is read.
RECORDINGS = {
    'rest_1': (gripped(8.0), 10.0),
    'rest_2': (gripped(8.0), 10.0),
    'taps_1': ({**gripped(12.0), 'taps': TAPS}, 14.0),
    **{f'slip_{k + 1}': (slipping(), 9.6) for k in range(6)},
}


@functools.cache
def _whole(name):
    """Rows of a recording and which of them slip; what many tests write is simulated once."""
    rows = samples(*RECORDINGS[name], seed=[*RECORDINGS].index(name))
    begin = round(BEGIN_S * RATE_HZ)
    return rows.volts[begin:], rows.truth[begin:] & name.startswith('slip')


def true_slip_s(name):
    """Seconds from its first row at which the slip of a recording begins and ends."""
    return (np.flatnonzero(np.diff(_whole(name)[1])) + 1) / RATE_HZ


@functools.cache
def rows_of(name):
    """Rows as a page records them, labelled by a hand."""
    volts, truth = _whole(name)
    if truth.any():
        # A hand presses the key late, and lets it go late.
        random = np.random.default_rng([*RECORDINGS].index(name))
        late = [random.uniform(0.12, 0.35), random.uniform(0.08, 0.3)]
        first, last = np.rint(RATE_HZ * (true_slip_s(name) + late)).astype(int)
        truth = (np.arange(len(truth)) >= first) & (np.arange(len(truth)) < last)
    stamps_ns = np.rint(1e9 / RATE_HZ * np.arange(len(volts))).astype(np.int64)
    return Samples(volts, stamps_ns, truth)


def write_recordings(folder, slips=6):
    """Write recordings as a page makes them: rest, taps, and one slip in each of some."""
    channels = [f'ch{c}' for c in range(1, 17)]
    for name in [*RECORDINGS][: 3 + slips]:
        folder.mkdir(exist_ok=True)
        kind = name.partition('_')[0]
        about = {'accuracy_s': BY_HAND_S} if kind == 'slip' else {'kind': kind}
        bag = BagWriter(folder / name, channels, **about)
        bag.write(rows_of(name))
        bag.close()
