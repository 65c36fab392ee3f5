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

"""Labelled recordings with all faults, on which tuner and evaluation must agree."""

import numpy as np
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig

RATE_HZ = 380.0
CHANNELS = 7
GROUPS = {'left': (1, 2, 3), 'right': (4, 5, 6, 7)}


@st.composite
def chains(draw):
    """Draw a chain of any vote, decision and threshold, with and without disabled channels."""
    disabled = draw(st.sampled_from([(), (2,), (4, 5)]), label='disabled')
    fewest = min(len(set(members) - set(disabled)) for members in GROUPS.values())
    exponent = draw(st.integers(1, 4), label='exponent')
    decision = {'threshold': draw(st.floats(0.1, 2.0), label='threshold')}
    if draw(st.booleans(), label='evidence'):
        limit_db_s = draw(st.sampled_from([0.3, 1.0, 3.0]), label='limit')
        decision = {
            'decision': 'evidence',
            'noise_floor': 0.3**exponent,
            'noise_floor_rate_db_s': 20.0,
            'evidence_limit_db_s': limit_db_s,
            'impact_v': draw(st.sampled_from([0.0, 5.0]), label='impact'),
            'mains_hz': draw(st.sampled_from([0.0, 50.0]), label='mains'),
            'threshold': limit_db_s * draw(st.floats(0.01, 0.99), label='share of the limit'),
        }
    return ChainConfig(
        channels=CHANNELS,
        groups=GROUPS,
        stopbands_hz=(),
        gain=1.0,
        flat_after_s=draw(st.sampled_from([0.0, 0.02]), label='flat'),
        exponent=exponent,
        common_mode=draw(st.sampled_from(['none', 'mean', 'median']), label='common mode'),
        disabled_channels=disabled,
        envelope_window_s=draw(st.sampled_from([0.003, 0.04]), label='envelope'),
        vote=draw(st.sampled_from(['all', 'mean', *range(1, fewest + 1)]), label='vote'),
        **decision,
    )


@st.composite
def recordings(draw):
    """Draw the pieces of a labelled recording with gaps, bad samples and rows of motion.

    It is noise that swells in the labelled intervals and, less, elsewhere.
    """
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1), label='seed'))
    n = draw(st.integers(2, 900), label='rows')
    truth = np.zeros(n, bool)
    for start in random.integers(0, n, draw(st.integers(0, 5), label='slips')):
        truth[start : start + random.integers(1, n // 4 + 2)] = True
    swell = np.interp(np.arange(n), np.linspace(0, n, 12), random.uniform(0.1, 2.0, 12))
    volts = (swell + truth)[:, None] * random.standard_normal((n, CHANNELS))
    bad_share = draw(st.sampled_from([0.0, 0.02, 0.3]), label='bad samples')
    volts[random.random(volts.shape) < bad_share] = np.nan
    if draw(st.booleans(), label='a channel is held'):
        volts[n // 3 : n // 2, random.integers(CHANNELS)] = 1.0
    stamps_ns = np.round(np.arange(n) * 1e9 / RATE_HZ).astype(np.int64)
    gaps = sorted(set(random.integers(1, n, draw(st.integers(0, 2), label='gaps')).tolist()))
    for at in gaps:
        stamps_ns[at:] += int(random.choice([700_000_000, -500_000_000]))
    cuts = sorted({*gaps, *random.integers(1, n, 2).tolist()})
    moving = random.random(n) < 0.5 if draw(st.booleans(), label='motion is known') else None
    return [
        Samples(
            volts[a:b],
            stamps_ns[a:b],
            truth[a:b],
            new_stretch=a in gaps,
            moving=None if moving is None else moving[a:b],
        )
        for a, b in zip([0, *cuts], [*cuts, n], strict=True)
    ]


EVALUATIONS = st.builds(
    EvaluationConfig,
    early_s=st.sampled_from([0.0, 0.05]),
    tail_s=st.sampled_from([0.0, 0.08]),
    off_before_s=st.sampled_from([0.0, 0.02, 0.1]),
)
