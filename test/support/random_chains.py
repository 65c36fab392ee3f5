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

"""Random configurations and recordings, and the chain on them against the reference."""

import dataclasses

import numpy as np
from hypothesis import strategies as st

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.compiled import COMPILED
from slip_detector.parameters import COMMON_MODES, ChainConfig
from slip_detector.vectors import LANES

MOST_ROWS = 200 if COMPILED else 120


@st.composite
def configs(draw, **fixed):
    """Draw a configuration over all options of the chain, with well-conditioned filters."""
    rate = draw(st.sampled_from([100.0, 380.0, 1000.0, 2012.5]), label='rate')
    # The last of several tiles mostly overlaps the one before it.
    channels = draw(st.one_of(st.integers(1, 40), st.integers(LANES + 1, 70)))
    order = draw(st.permutations(range(1, channels + 1)), label='order')
    n_enabled = draw(st.one_of(st.just(channels), st.integers(1, channels)), label='enabled')
    enabled, disabled = order[:n_enabled], order[n_enabled:]
    n_groups = draw(st.integers(1, min(len(enabled), 6)), label='groups')
    groups = {f'g{i}': enabled[i::n_groups] for i in range(n_groups)}
    # A vote of more channels than a group has enabled is refused.
    votes = st.one_of(
        st.sampled_from(['all', 'mean']), st.integers(1, min(len(m) for m in groups.values()))
    )
    if disabled and draw(st.booleans(), label='a group lists a disabled channel'):
        groups['g0'] = [*groups['g0'], disabled[0]]
    if draw(st.booleans(), label='high-pass'):
        passband = (draw(st.floats(0.01, 0.3)) * rate, 0.0)
        degree = draw(st.integers(1, 4))
    else:
        low = draw(st.floats(0.01, 0.2)) * rate
        passband = (low, low + draw(st.floats(0.03, 0.25)) * rate)
        degree = draw(st.sampled_from([2, 4, 6]))
    bands = st.tuples(st.floats(0.005, 0.3), st.floats(0.02, 0.18))
    stopbands = draw(st.lists(bands, max_size=3), label='low edges and widths of stop-bands')
    values = {
        'sample_rate_hz': rate,
        'channels': channels,
        'disabled_channels': disabled,
        'valid_range_v': draw(st.sampled_from([(-1e9, 1e9), (-7.0, 8.0)])),
        'flat_after_s': draw(st.sampled_from([0.0, 1.0, 5.0, 30.0])) / rate,
        'common_mode': draw(st.sampled_from(COMMON_MODES)),
        'passband_hz': passband,
        'passband_degree': degree,
        'gain': draw(st.sampled_from([0.5, 1.0, 100.0])),
        'stopbands_hz': [(low * rate, (low + width) * rate) for low, width in stopbands],
        'stopband_degree': draw(st.sampled_from([2, 4])),
        'stopband_ripple_db': draw(st.sampled_from([0.01, 0.5])),
        'stopband_attenuation_db': draw(st.sampled_from([20.0, 40.0])),
        'rectify': draw(st.sampled_from(['full', 'half'])),
        'exponent': draw(st.integers(1, 6)),
        'envelope_window_s': draw(st.integers(1, 50)) / rate,
        'decision_window_s': draw(st.integers(1, 50)) / rate,
        'vote': draw(votes),
        'groups': groups,
    }
    return ChainConfig(**values | fixed)


@st.composite
def recordings(draw, config):
    """Draw rows with baselines, hum, noise, bad samples, late starters and still stretches."""
    n = draw(st.integers(1, MOST_ROWS), label='rows')
    c = config.channels
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1), label='seed'))
    phases = rng.uniform(0.01, 0.4, c) * np.arange(n)[:, None] + rng.uniform(0, 1, c)
    volts = rng.uniform(-4, 5, c) + rng.uniform(0, 1, c) * np.sin(2 * np.pi * phases)
    volts += 0.2 * rng.normal(size=(n, c)) * rng.integers(0, 2, c)
    volts += 0.5 * np.sin(2 * np.pi * 0.13 * np.arange(n))[:, None]
    if draw(st.booleans(), label='coarse converter'):
        volts = np.round(volts * 4) / 4
    if draw(st.booleans(), label='still stretches'):
        for column in range(c):
            a, b = sorted(rng.integers(0, n + 1, 2))
            volts[a:b, column] = volts[min(a, n - 1), column]
    if draw(st.booleans(), label='bad samples'):
        bad = rng.uniform(size=(n, c)) < 0.05
        volts[bad] = rng.choice([np.nan, np.inf, -np.inf, 1e300, -2e9], size=bad.sum())
    if draw(st.booleans(), label='late starters'):
        for column in rng.permutation(c)[: c // 2 + 1]:
            volts[: rng.integers(0, n + 1), column] = np.nan
    return volts


def round_off(config, volts, envelope):
    """Return how far two exact ways of computing envelope or level may lie apart.

    The two ways filter the baseline differently: their filtered signals differ by the round-off
    of the volts through the network, ``delta``. The power makes k delta / peak of it.
    """
    low, high = config.valid_range_v
    good = np.abs(volts[(volts >= low) & (volts <= high)])
    delta = 1e-12 * config.gain * good.max(initial=0.0)
    # One sample in the window can be this much larger than the envelope.
    peak = np.sqrt(config.samples(config.envelope_window_s)) * envelope.max(initial=0.0)
    base = peak ** (1 / config.exponent)
    return (base + delta) ** config.exponent - base**config.exponent + 1e-12 * peak


def assert_same_votes(config, result, groups, level):
    """Compare the groups' decisions, but for mean votes that round-off decides.

    ``level`` is what the vote is about.
    """
    differ = result.groups != groups
    if config.vote == 'mean':
        with np.errstate(divide='ignore'):
            logs = np.where(result.valid, np.log(level) - np.log(config.threshold), 0.0)
        for g, members in enumerate(config.groups.values()):
            score = logs[:, np.array(members) - 1].sum(axis=1)
            differ[:, g] &= (np.abs(score) > 1e-9) | ~result.can_vote[:, g]
    assert not differ.any()
    assert np.array_equal(result.slip, result.groups.any(axis=1))


@st.composite
def with_evidence(draw, config, volts):
    """Draw a configuration that decides by evidence, with floors within the envelopes."""
    rate = config.sample_rate_hz
    rows = draw(st.integers(3, 12), label='rows of a mains period')
    mains_hz = draw(st.sampled_from([0.0, rate / rows]), label='mains')
    mean = dataclasses.replace(config, mains_hz=mains_hz, threshold=1.0)
    envelopes = SlipChain(mean).update(volts).envelope
    positive = envelopes[envelopes > 0]
    middle = float(np.median(positive)) if positive.size else 1.0
    # None; one; as many as channels, or not, of which the first is for all.
    n_floors = draw(st.sampled_from([0, 1, config.channels, config.channels + 1]), label='floors')
    floors = [middle * 10 ** draw(st.floats(-1.5, 0.5)) for _ in range(n_floors)]
    offset_db = draw(st.sampled_from([0.0, 3.5, 7.0]))
    limit_db_s = draw(st.sampled_from([0.02, 0.3, 1.3]))
    enabled = config.channels - len(config.disabled_channels)
    high_hz = config.passband_hz[0] * draw(st.floats(0.5, 1.0), label='edges of the low band')
    return dataclasses.replace(
        config,
        mains_hz=mains_hz,
        decision='evidence',
        noise_floor=[min(max(floor, 1e-30), 1e30) for floor in floors],
        noise_floor_learnt=draw(st.booleans()),
        noise_floor_range_db=draw(st.sampled_from([0.0, 6.0, 60.0])),
        noise_floor_rate_db_s=draw(st.sampled_from([0.0, 0.43, 20.0, 1000.0])),
        evidence_cap_db=offset_db + draw(st.sampled_from([1.0, 10.0])),
        evidence_offset_db=offset_db,
        evidence_limit_db_s=limit_db_s,
        impact_v=draw(st.sampled_from([0.0, 0.3, 1.0, 3.0])),
        impact_channels=draw(st.integers(1, min(enabled, 4))),
        impact_s=draw(st.sampled_from([0, 1, 2, 7])) / rate,
        impact_hold_s=draw(st.integers(0, 30)) / rate,
        contact_level_v=draw(st.sampled_from([0.0, 0.003, 0.02, 0.1])),
        contact_channels=draw(st.integers(1, min(enabled, 4))),
        contact_hold_s=draw(st.integers(0, 30)) / rate,
        activity_band_hz=(high_hz / 2, high_hz),
        activity_range_db=draw(st.sampled_from([-10.0, 0.0, 15.0])),
        activity_cap_db=draw(st.sampled_from([0.0, 3.0, 8.7])),
        common_rank=draw(st.integers(0, min(enabled - 1, 3))),
        threshold=limit_db_s * draw(st.sampled_from([0.01, 0.1, 0.5, 0.9])),
    )


@st.composite
def cases(draw):
    """Draw a chain of either decision, rows of volts, and what else is kept of its results."""
    config = draw(configs(threshold=0.05))
    volts = draw(recordings(config))
    kept = {'votes': draw(st.sampled_from([(), ('all', 'mean', 1, 2, 3)]), label='votes')}
    if draw(st.booleans(), label='evidence'):
        return draw(with_evidence(config, volts)), volts, kept | {'floor': True, 'excess': True}
    return config, volts, kept
