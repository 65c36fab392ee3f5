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

"""Labels against the signal: late ones are moved, and recordings that contradict them named."""

import dataclasses

import numpy as np
import pytest

from benchmarks.tune.families import disturbances
from slip_detector.chain.samples import Samples
from slip_detector.evaluation.scores import SLIP
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.yaml_files import read_yaml
from slip_detector.recordings.labels import label_times
from slip_detector.scenes import Scene, find_scene
from slip_detector.tuning.labels import contradictions, snap_labels
from slip_detector.tuning.tracks import track_of
from support.tuning_cases import CHAIN, EVIDENCE, RATE_HZ, slips, track_with


def slid(name, late_s, accuracy_s=0.35, changes=True):
    """Return a recording that slides from 2 s to 4 s, labelled late."""
    volts = np.random.default_rng(len(name)).normal(size=(round(6 * RATE_HZ), 4))
    at_ns = Samples.evenly(volts, RATE_HZ, volts[:, 0]).stamps_ns
    volts[(at_ns >= 2_000_000_000) & (at_ns < 4_000_000_000)] *= 6.0 if changes else 1.0
    edges_ns = np.rint(1e9 * (np.array([2.0, 4.0]) + late_s)).astype(np.int64)
    label = label_times(at_ns, edges_ns, accuracy_s)
    return track_of(name, [Samples(volts, at_ns, **label, accuracy_s=accuracy_s)], RATE_HZ)


def test_each_label_is_where_the_power_changes_and_as_exact_as_what_was_found():
    late, unknown, exact = slid('late', 0.3), slid('none', 0.2, changes=False), slid('x', 0.2, 0.1)
    tracks, sentences = snap_labels([late, unknown, exact])
    assert tracks[0].slips[0] == pytest.approx((760, 1520), abs=4)
    certain = np.flatnonzero(~tracks[0].samples.certain) / RATE_HZ
    assert np.abs(certain - np.where(certain < 3.0, 2.0, 4.0)).max() < 0.12
    assert [track.samples.accuracy_s for track in tracks] == [0.1, 0.35, 0.1]
    assert tracks[1].slips == unknown.slips
    np.testing.assert_array_equal(tracks[1].samples.certain, unknown.samples.certain)
    assert tracks[2] is exact
    assert sentences[0].startswith('late: start 2.30 -> 2.0')
    assert sentences[1:] == ['none: none of 2 ends is known; ± 0.35 s']


def test_hands_later_than_was_said_are_told_the_accuracy_that_fits():
    *_, said = snap_labels([slid('a', 0.52), slid('b', 0.3), slid('c', 0.2)])[1]
    assert said.startswith('1 of 3 labels by hand were off by up to 0.5')
    assert said.endswith(' s: accuracy_s: 0.6 fits')
    assert len(snap_labels([slid('a', 0.3), slid('b', 0.3)])[1]) == 2


def played(parts, seed, name='plate_400um', kind=''):
    scene = Scene({**read_yaml(find_scene(name)), **parts}, np.random.default_rng(seed))
    samples = scene.read(round(60.0 * scene.sample_rate_hz))
    truth = samples.truth & (not kind)
    rows = samples._replace(truth=truth, kind=kind)
    return track_of(f'{kind or "slip"} {seed}', [rows], scene.sample_rate_hz)


#: What is added to the plates; what rolls may be as loud as a slide.
FAMILIES = {
    name: {part: of for part, of in parts.items() if part != 'rolling'}
    for name, parts in disturbances().items()
    if name != 'presses'
}

#: As the live page begins with a new sensor.
PAGE = ChainConfig(passband_hz=(20.0, 0.0), passband_degree=2, stopbands_hz=(), exponent=1)


@pytest.mark.parametrize('seed', [0, 10])
@pytest.mark.parametrize('family', FAMILIES)
def test_honest_recordings_contradict_nothing_and_others_their_kind(family, seed):
    parts, plates = FAMILIES[family], ('plate_400um', 'plate_440um', 'plate_480um')
    grip = {'duration_s': 0.8, 'force_n': 0.4}
    still = {'steps': [{'duration_s': 1.0}, grip, {'duration_s': 9}]}
    honest = [played(parts, seed + k, name) for k, name in enumerate(plates)]
    rest = played({**parts, **still}, seed + 5, kind='rest')
    press = played({**parts, 'rolling': {'start_s': 4.0}, **still}, seed + 6, kind='press')
    # A rest that slides, and slips at times at which nothing slides.
    slides = played(parts, seed + 7, kind='rest')
    truth = np.roll(honest[0].samples.truth, -round(1.5 * 380))
    truth = (honest[0].row_classes != SLIP) & truth & (np.cumsum(truth) < 300)
    missed = track_of('missed', [honest[0].samples._replace(truth=truth)], 380.0)
    for chain in (ChainConfig(), PAGE):
        assert contradictions(chain, [*honest, rest, press]) == ([], [])
        (said,), _ = contradictions(chain, [*honest, rest, slides])
        assert said.startswith(f'rest {seed + 7} is labelled rest, but the level is as in a slide')
        (said,), mistakes = contradictions(chain, [*honest[1:], rest, missed])
        assert said.startswith('missed: nothing changes at its slips, at ')
        assert mistakes == [missed]


def test_where_slips_are_no_louder_than_rest_nothing_is_said():
    volts, truth = slips(3, slip_hz=40.0)
    tracks = [track_with(volts, truth), track_with(volts, kind='rest')]
    deaf = dataclasses.replace(EVIDENCE, passband_hz=(180.0, 0.0))
    assert contradictions(deaf, tracks) == ([], [])
    assert len(contradictions(CHAIN, tracks)[0]) == 1
