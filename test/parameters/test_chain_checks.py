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

"""The parameters of mains and evidence, against each other."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from slip_detector.parameters.chain_checks import LONGEST_COMB_S
from slip_detector.parameters.detector import WHOLE_PERIODS, ChainConfig, DetectorConfig
from support.config_cases import message_of

EVIDENCE = {'decision': 'evidence', 'noise_floor': 0.5}
HIGH_PASS = {'stopbands_hz': (), 'passband_degree': 1}


@pytest.mark.parametrize(
    ('rate_hz', 'mains_hz', 'rows'),
    [
        (380.0, 0.0, 0),
        (312.5, 50.0, 25),
        (380.0, 50.0, 38),
        (380.0, 60.0, 19),
        (60.0, 50.0, 6),
        (1000.0, 50.0, 20),
        (1000.0, 60.0, 50),
        (44_100.0, 60.0, 735),
        (1e5, 50.0, 2000),
        (50.0, 50.0, 1),
        (30.0, 60.0, 1),
        (333.333, 50.0, 20),
        (380.0, 4.0, 95),
    ],
)
def test_the_mains_has_the_fewest_rows_of_whole_periods(rate_hz, mains_hz, rows):
    config = ChainConfig(
        sample_rate_hz=rate_hz, mains_hz=mains_hz, passband_hz=(7.0, 0.0), **HIGH_PASS
    )
    assert config.mains_rows == rows


@given(st.floats(20.0, 2e5), st.sampled_from([16.7, 50.0, 60.0, 400.0]))
def test_rows_of_the_mains_are_whole_periods_or_the_mains_is_refused(rate_hz, mains_hz):
    def off(rows):
        periods = rows * mains_hz / rate_hz
        return abs(periods - round(periods))

    most = int(LONGEST_COMB_S * rate_hz)
    assume(most <= 2000)
    able = [rows for rows in range(1, most + 1) if off(rows) <= WHOLE_PERIODS]
    # At a rate far above the mains' a few rows are nearly none of it, which is no period.
    able = [rows for rows in able if rows * mains_hz / rate_hz > 0.5]
    values = {'sample_rate_hz': rate_hz, 'mains_hz': mains_hz, 'passband_hz': (5.0, 0.0)}
    windows = {'envelope_window_s': 0.1, 'decision_window_s': 0.1}
    if able:
        assert ChainConfig(**values, **windows, **HIGH_PASS).mains_rows == able[0]
    else:
        message = message_of(ChainConfig, **values, **windows, **HIGH_PASS)
        assert message.startswith(f'parameter mains_hz is {mains_hz:g} Hz, allowed: 0, or')


@pytest.mark.parametrize(
    ('values', 'said'),
    [
        ({'noise_floor': ()}, 'noise_floor is not given, allowed: one number, or 16, one for'),
        ({'noise_floor': (1.0, 2.0)}, 'noise_floor has 2 numbers, allowed: one number, or 16'),
        ({'noise_floor': 0.0}, 'noise_floor is 0, allowed: 1e-30 to 1e+30'),
        ({'noise_floor': 'loud'}, "noise_floor is 'loud', allowed: a number"),
        ({'noise_floor': [None]}, 'noise_floor is None, allowed: a number'),
        ({'noise_floor_learnt': 1}, 'noise_floor_learnt is 1, allowed: true, false'),
        ({'noise_floor_range_db': -1}, 'noise_floor_range_db is -1 dB, allowed: 0 to 300 dB'),
        ({'noise_floor_rate_db_s': 1e4}, 'is 10000 dB/s, allowed: 0 to 1000 dB/s'),
        ({'evidence_cap_db': 3.5}, 'evidence_cap_db is 3.5 dB, allowed: above evidence_offset_db'),
        ({'evidence_cap_db': 301}, 'is 301 dB, allowed: above evidence_offset_db, to 300'),
        ({'evidence_offset_db': -1}, 'evidence_offset_db is -1 dB, allowed: 0 to 100 dB'),
        ({'evidence_limit_db_s': 0}, 'evidence_limit_db_s is 0 dB s, allowed: 1e-06 to 1e+06'),
        ({'threshold': 1.3}, 'threshold is 1.3 dB s, allowed: below evidence_limit_db_s (1.3'),
        ({'impact_v': -1}, 'impact_v is -1 V, allowed: 0 to 1e+12 V'),
        ({'impact_channels': 0}, 'impact_channels is 0, allowed: 1 to the number of enabled'),
        ({'impact_v': 1, 'impact_channels': 17}, 'impact_channels is 17, allowed: at most 16'),
        ({'impact_hold_s': 61}, 'impact_hold_s is 61 s, allowed: 0 to 60 s'),
        ({'decision': 'cusum'}, "decision is 'cusum', allowed: mean, evidence"),
        ({'mains_hz': 3.9}, 'mains_hz is 3.9 Hz, allowed: 0, or a frequency with whole periods'),
    ],
)
def test_what_evidence_cannot_be_decided_with_is_refused(values, said):
    message = message_of(ChainConfig, **EVIDENCE | values)
    assert message.startswith('parameter ')
    assert said in message


def test_what_only_evidence_needs_is_not_asked_of_the_mean():
    values = {'threshold': 2.0, 'impact_v': 1.0, 'impact_channels': 99, 'noise_floor': (1, 2)}
    assert ChainConfig(**values).threshold == 2.0


def test_impacts_need_enabled_channels_only_where_there_are_any():
    values = {'channels': 2, 'disabled_channels': (1,), **EVIDENCE}
    assert ChainConfig(**values).impact_channels == 2
    message = message_of(ChainConfig, **values, impact_v=1.0)
    assert message.endswith('allowed: at most 1, the number of enabled channels')


def test_more_noise_floors_than_channels_are_refused_whatever_decides():
    said = 'parameter noise_floor has 100000 numbers, allowed: at most 16, one for each channel'
    assert message_of(ChainConfig, noise_floor=[1.0] * 100_000) == said


def test_a_noise_floor_is_one_number_or_one_a_channel_in_yaml_too(tmp_path):
    one = DetectorConfig(channels=3, decision='evidence', noise_floor=0.25)
    assert one.noise_floors == (0.25, 0.25, 0.25)
    several = DetectorConfig(channels=3, decision='evidence', noise_floor=[0.25, 1, '5e-1'])
    assert several.noise_floors == (0.25, 1.0, 0.5)
    for config in (one, several, DetectorConfig(channels=3)):
        path = tmp_path / 'detector.yaml'
        path.write_text(config.to_yaml())
        assert DetectorConfig.from_yaml(path) == config
    path.write_text('slip_detector: {ros__parameters: {decision: evidence, noise_floor: 1e-3}}')
    assert DetectorConfig.from_yaml(path).noise_floor == (1e-3,)
