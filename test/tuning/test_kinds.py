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

"""What recordings of kinds teach, and which of them contradict their kind."""

import dataclasses

import numpy as np
import pytest

from benchmarks.tune.families import disturbances
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.scores import SLIP
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.files import read_yaml
from slip_detector.scenes import Scene, find_scene
from slip_detector.tuning.kinds import contact_level_v, contradictions
from slip_detector.tuning.tracks import track_of
from support.tuning_cases import CHAIN, EVIDENCE, slips, track_with


def test_contact_begins_above_a_finger_that_touches_nothing_and_below_one_that_slides():
    volts, truth = slips(1, slip_hz=14.0)
    idle = 4.3 + 0.002 * np.random.default_rng(2).standard_normal((4000, 4))
    of_idle = track_with(idle, kind='idle')
    level_v = contact_level_v(EVIDENCE, [track_with(volts, truth), of_idle])
    gated = SlipChain(dataclasses.replace(EVIDENCE, contact_level_v=level_v))
    assert not gated.update(idle, excess=True).excess.any()
    gated.reset()
    assert gated.update(volts, excess=True).excess[truth].any(axis=1).mean() > 0.8
    # Where a finger always touches there is no level.
    for more in ([], [track_with(volts, kind='idle')]):
        with pytest.raises(ValueError, match=r'touches nothing has a level of .* allowed: 1\.2 t'):
            contact_level_v(EVIDENCE, [track_with(volts, truth), *more])
    # A slide that sticks for half of its time is in contact by its loudest rows.
    sticks = np.arange(len(volts)) % 1140 < 703
    volts[sticks] = np.resize(idle, volts.shape)[sticks]
    assert contact_level_v(EVIDENCE, [track_with(volts, truth), of_idle]) > 0.0


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


@pytest.mark.parametrize('chain', [ChainConfig(), PAGE], ids=['paper', 'page'])
@pytest.mark.parametrize('family', FAMILIES)
def test_honest_recordings_contradict_nothing_and_others_their_kind(family, chain):
    parts, plates = FAMILIES[family], ('plate_400um', 'plate_440um', 'plate_480um')
    grip = {'duration_s': 0.8, 'force_n': 0.4}
    still = {'steps': [{'duration_s': 1.0}, grip, {'duration_s': 9}]}
    for seed in range(0, 20, 10):
        honest = [played(parts, seed + k, name) for k, name in enumerate(plates)]
        rest = played({**parts, **still}, seed + 5, kind='rest')
        press = played({**parts, 'rolling': {'start_s': 4.0}, **still}, seed + 6, kind='press')
        assert contradictions(chain, [*honest, rest, press]) == ([], [])
        # A rest that slides, and slips at times at which nothing slides.
        slides = played(parts, seed + 7, kind='rest')
        (said,), _ = contradictions(chain, [*honest, rest, slides])
        assert said.startswith(f'rest {seed + 7} is labelled rest, but the level is as in a slide')
        truth = np.roll(honest[0].samples.truth, -round(1.5 * 380))
        truth = (honest[0].row_classes != SLIP) & truth & (np.cumsum(truth) < 300)
        nothing = honest[0].samples._replace(truth=truth)
        missed = track_of('missed', [nothing], 380.0)
        (said,), mistakes = contradictions(chain, [*honest[1:], rest, missed])
        assert said.startswith('missed: nothing changes at its slips, at ')
        assert mistakes == [missed]


def test_where_slips_are_no_louder_than_rest_nothing_is_said():
    volts, truth = slips(3, slip_hz=40.0)
    tracks = [track_with(volts, truth), track_with(volts, kind='rest')]
    deaf = dataclasses.replace(EVIDENCE, passband_hz=(180.0, 0.0))
    assert contradictions(deaf, tracks) == ([], [])
    assert len(contradictions(CHAIN, tracks)[0]) == 1
