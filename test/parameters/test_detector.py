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

"""The parameters of chain and detector: what the defaults are made of, and what goes together."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.chain import (
    LONGEST_COMB_S,
    LOWEST_EDGE,
    PAPER_GROUPS,
    WHOLE_PERIODS,
    ChainConfig,
)
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.files import shared_folder
from slip_detector.parameters.sections import parameters_for
from support.config_cases import message_of


def test_groups_are_table_1_or_one_for_all_without_disabled_channels_and_emptied_groups():
    assert ChainConfig().groups == PAPER_GROUPS
    config = ChainConfig(disabled_channels=(14, 1, 3, 8, 6))
    assert config.groups == {'TP': (16, 11, 9), 'LR': (5, 7, 12, 10), 'LU': (2, 4, 15, 13)}
    assert ChainConfig(channels=3, disabled_channels=[2]).groups == {'all': (1, 3)}


def test_a_time_is_rounded_to_samples_and_at_least_one():
    config = ChainConfig(sample_rate_hz=100.0, stopbands_hz=(), passband_hz=(7, 45))
    assert [config.samples(s) for s in (0.0, 0.0149, 0.0151, 1.0)] == [1, 1, 2, 100]


TWO = {'channels': 2}
EVIDENCE = {'decision': 'evidence', 'noise_floor': 0.5}
CONTACT = {**EVIDENCE, 'contact_level_v': 1.0}
WINDOWS = {'envelope_window_s': 0.1, 'decision_window_s': 0.1}

#: Values that do not go together, and the message after the word parameter.
REFUSED = [
    ({'passband_hz': (7, 7)}, 'passband_hz has 7 and 7 Hz, allowed: rising, 0.0038 Hz to below'),
    ({'passband_hz': (7, -50)}, 'passband_hz has 7 and -50 Hz, allowed: rising'),
    ({'sample_rate_hz': 80}, 'passband_hz has 7 and 50 Hz, allowed: rising, 0.0008 Hz to below'),
    ({'stopbands_hz': ((1, 2), (7, 0.5))}, 'stopbands_hz has 7 and 0.5 Hz, allowed: rising'),
    ({'stopbands_hz': (0.5, 7) * 33}, 'stopbands_hz has 33 pairs, allowed: at most 32'),
    ({'passband_degree': 3}, 'passband_degree is 3, allowed: an even number (a band-pass has'),
    ({'stopband_degree': 5}, 'stopband_degree is 5, allowed: even, 2 to 20'),
    ({'mains_hz': 3.9}, 'mains_hz is 3.9 Hz, allowed: 0, or up to 1000 with whole periods in at'),
    ({'disabled_channels': (17,)}, 'disabled_channels is (17,), allowed: some of 1 to 16, not'),
    ({**TWO, 'disabled_channels': (1, 2)}, 'disabled_channels is (1, 2), allowed: some of 1 to 2'),
    ({**TWO, 'channel_names': ('a', 'b', 'c')}, 'channel_names has 3 names, allowed: 2, the'),
    (
        {**TWO, 'groups': {'a': [1, 2], 'b': [2]}},
        'groups is wrong about channels [2], allowed: each of',
    ),
    ({**TWO, 'groups': {'a': [1]}}, 'groups is wrong about channels [2], allowed: each of 1 to 2'),
    ({**TWO, 'groups': {'a': [1, 2], 'b': []}}, "groups is {'a': (1, 2), 'b': ()}, allowed: no"),
    ({'vote': 5}, 'vote is 5, allowed: at most 4, the enabled channels of the smallest group'),
    ({'disabled_channels': (14, 16), 'vote': 3}, 'vote is 3, allowed: at most 2, the enabled'),
    ({'envelope_window_s': 0.002}, 'envelope_window_s is 0.002 s, allowed: at least one sample'),
    ({'decision_window_s': 0.0}, 'decision_window_s is 0 s, allowed: at least one sample'),
    ({'valid_range_v': (4, 4)}, 'valid_range_v is (4.0, 4.0), allowed: each number above the one'),
    ({**EVIDENCE, 'evidence_cap_db': 3.5}, 'evidence_cap_db is 3.5 dB, allowed: above'),
    ({**EVIDENCE, 'threshold': 1.3}, 'threshold is 1.3, allowed: above 0, below evidence_limit_'),
    (
        {**EVIDENCE, **TWO, 'disabled_channels': (1,), 'impact_v': 1.0},
        'impact_channels is 2, allowed: at most 1, the number of enabled channels',
    ),
    ({'impact_s': 1.5}, 'impact_s is 1.5 s, allowed: 0 to 1 s'),
    (
        {**CONTACT, 'activity_band_hz': (8.0, 190.0)},
        'activity_band_hz has 8 and 190 Hz, allowed: rising, 0.0038 Hz to below 190 Hz',
    ),
    ({**CONTACT, **TWO}, 'contact_channels is 4, allowed: at most 2, the number of enabled'),
    (
        {**EVIDENCE, 'activity_cap_db': 8.7},
        'activity_band_hz is (8.0, 20.0), allowed: up to 7 Hz, the low edge of passband_hz, with',
    ),
    ({'taxel_positions_m': (0.0,) * 47}, 'taxel_positions_m has 47 numbers, allowed: 48, three'),
]


@pytest.mark.parametrize(('values', 'said'), REFUSED)
def test_parameters_that_do_not_go_together_are_refused(values, said):
    assert message_of(DetectorConfig, **values).startswith(f'parameter {said}')


def test_parameters_of_the_evidence_and_of_its_stages_are_not_checked_without_these():
    values = {'threshold': 2.0, 'impact_v': 1.0, 'impact_channels': 99}
    values |= {'contact_level_v': 1.0, 'contact_channels': 99, 'activity_cap_db': 8.7}
    assert ChainConfig(**values).threshold == 2.0
    band = {'passband_hz': (7.0, 0.0), 'stopbands_hz': (), 'passband_degree': 2}
    assert ChainConfig(**EVIDENCE, **band, **WINDOWS, sample_rate_hz=30.0).low_band_hz == ()


@pytest.mark.parametrize(
    ('given', 'floors', 'said'),
    [
        ((), (), 'no noise_floor: each channel begins at its first envelope, and'),
        ((0.5,), (0.5,), ''),
        ((0.5, 2.0, 1.0), (0.5, 2.0, 1.0), ''),
        ((0.5, 2.0), (0.5,), 'noise_floor has 2 numbers for 3 channels: the first is used for'),
    ],
)
def test_any_number_of_floors_is_allowed_and_one_remark_says_what_it_means(given, floors, said):
    config = ChainConfig(channels=3, decision='evidence', noise_floor=given)
    assert config.floors == floors
    assert [words[: len(said)] for words in config.remarks()] == ([said] if said else [])
    assert ChainConfig(channels=3, noise_floor=given).remarks() == []


FOLDER = shared_folder() / 'config'
FILES = [*FOLDER.glob('*.yaml'), *FOLDER.glob('sensors/*.yaml')]


def values_in(path):
    """Return what a file sets, as the parameters that it becomes."""
    parameters = DetectorConfig.from_yaml(path).to_parameters()
    return {name: parameters[name] for name in parameters_for(path, 'slip_detector').values}


IN_FILES = {str(path.relative_to(FOLDER)): values_in(path) for path in FILES}


@pytest.mark.parametrize('first', IN_FILES)
def test_every_file_of_config_is_loaded_onto_every_other_at_once_and_by_single_parameters(first):
    before = DetectorConfig.from_parameters(IN_FILES[first])
    for values in IN_FILES.values():
        assert values.items() <= before.with_values(values).to_parameters().items()
        # Channels first, then any order; what is refused comes again after the others.
        groups = {name: value for name, value in values.items() if name.startswith('groups')}
        single = [{name: values[name]} for name in sorted(values) if name not in groups]
        parts = [{'channels': values.get('channels', 16)}, groups, *single]
        config = before
        while parts:
            refused = []
            for part in parts:
                try:
                    config = config.with_values(part)
                except ValueError:
                    refused.append(part)
            assert len(refused) < len(parts)
            parts = refused
        assert values.items() <= config.to_parameters().items()


@pytest.mark.parametrize('rate', [1.0, 100.0, 380.0, 1e6])
def test_edges_are_allowed_from_their_share_of_the_rate_to_below_half_of_it(rate):
    def build(low, high):
        windows = {'envelope_window_s': 1 / rate, 'decision_window_s': 1 / rate}
        band = {'passband_hz': (low, high), 'stopbands_hz': ()}
        return ChainConfig(sample_rate_hz=rate, **band, **windows)

    low, high = LOWEST_EDGE * rate, math.nextafter(rate / 2, 0)
    # As the message writes it, which may be a last digit below.
    assert build(float(f'{low:g}'), high).samples(1 / rate) == 1
    assert 'passband_hz' in message_of(build, low * (1 - 1e-9), high)
    assert 'passband_hz' in message_of(build, low, rate / 2)


@given(st.floats(20.0, 8000.0), st.sampled_from([16.7, 50.0, 60.0, 400.0]))
def test_rows_of_the_mains_are_whole_periods_or_the_mains_is_refused(rate_hz, mains_hz):
    def off(rows):
        periods = rows * mains_hz / rate_hz
        return abs(periods - round(periods))

    most = int(LONGEST_COMB_S * rate_hz)
    able = [rows for rows in range(1, most + 1) if off(rows) <= WHOLE_PERIODS]
    # At a rate far above the mains' a few rows are nearly none of it, which is no period.
    able = [rows for rows in able if rows * mains_hz / rate_hz > 0.5]
    values = {'sample_rate_hz': rate_hz, 'mains_hz': mains_hz, **WINDOWS}
    values |= {'passband_hz': (5.0, 0.0), 'passband_degree': 1, 'stopbands_hz': ()}
    if able:
        assert ChainConfig(**values).mains_rows == able[0]
    else:
        message = message_of(ChainConfig, **values)
        assert message.startswith(f'parameter mains_hz is {mains_hz:g} Hz, allowed: 0, or')
