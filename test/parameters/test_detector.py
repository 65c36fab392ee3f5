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

"""The parameters of chain and detector: the paper's defaults, and what is refused."""

import math
import re

import pytest

from slip_detector.parameters.chain_checks import LOWEST_EDGE
from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from support.config_cases import message_of

NAN, INF = math.nan, math.inf


# --- defaults ------------------------------------------------------------------------------


def test_the_papers_windows_are_15_samples():
    config = ChainConfig()
    assert config.samples(config.envelope_window_s) == 15
    assert config.samples(config.decision_window_s) == 15


def test_names_are_ch1_and_on_unless_given():
    assert ChainConfig(channels=3).names == ('ch1', 'ch2', 'ch3')
    assert ChainConfig(channels=2, channel_names=('left', 'right')).names == ('left', 'right')


def test_groups_are_table_1_for_16_channels_and_one_for_any_other_number():
    assert (
        ChainConfig().groups
        == DetectorConfig().groups
        == {
            'TP': (14, 16, 11, 9),
            'TD': (1, 3, 8, 6),
            'LR': (5, 7, 12, 10),
            'LU': (2, 4, 15, 13),
        }
    )
    assert ChainConfig(channels=5).groups == {'all': (1, 2, 3, 4, 5)}


def test_default_groups_leave_out_disabled_channels_and_emptied_groups():
    config = ChainConfig(disabled_channels=(14, 1, 3, 8, 6))
    assert config.groups == {
        'TP': (16, 11, 9),
        'LR': (5, 7, 12, 10),
        'LU': (2, 4, 15, 13),
    }
    assert ChainConfig(channels=3, disabled_channels=[2]).groups == {'all': (1, 3)}


# --- what is refused -----------------------------------------------------------------------


SIXTEEN = tuple(range(1, 17))

# Parameter, other values, the parameter's bad value, what the message shows of it, and what it
# says is allowed.
REFUSED = [
    # Out of range, on either side.
    ('sample_rate_hz', {}, 0.5, '0.5 Hz', '1 to 1e+06 Hz'),
    ('sample_rate_hz', {}, 2e6, '2e+06 Hz', '1 to 1e+06 Hz'),
    ('sample_rate_hz', {}, -380, '-380 Hz', '1 to 1e+06 Hz'),
    ('sample_rate_hz', {}, INF, 'inf Hz', '1 to 1e+06 Hz'),
    ('channels', {}, 0, '0', '1 to 1e+06'),
    ('channels', {}, 10**7, '1e+07', '1 to 1e+06'),
    ('flat_after_s', {}, -0.1, '-0.1 s', '0 to 3600 s'),
    ('passband_degree', {}, 0, '0', '1 to 20'),
    ('passband_degree', {}, 22, '22', '1 to 20'),
    ('gain', {}, 0, '0', '1e-06 to 1e+06'),
    ('gain', {}, -INF, '-inf', '1e-06 to 1e+06'),
    ('stopband_degree', {}, 0, '0', '2 to 20'),
    ('stopband_ripple_db', {}, 0, '0 dB', '0.0001 to 3 dB'),
    ('stopband_attenuation_db', {}, 200, '200 dB', '6 to 120 dB'),
    ('exponent', {}, 7, '7', '1 to 6'),
    ('exponent', {}, 0, '0', '1 to 6'),
    ('envelope_window_s', {}, 61, '61 s', 'to 60 s'),
    ('decision_window_s', {}, -1, '-1 s', 'to 60 s'),
    ('threshold', {}, 0, '0', '1e-30 to 1e+30'),
    ('threshold', {}, -0.5, '-0.5', '1e-30 to 1e+30'),
    ('valid_range_v', {}, (-1e13, 5), '-1e+13 V', '-1e+12 to 1e+12 V'),
    ('valid_range_v', {}, (0, INF), 'inf V', '-1e+12 to 1e+12 V'),
    # Wrong type.
    ('sample_rate_hz', {}, 'fast', "'fast'", 'a number'),
    ('sample_rate_hz', {}, None, 'None', 'a number'),
    ('sample_rate_hz', {}, [380], '[380]', 'a number'),
    ('sample_rate_hz', {}, True, 'True', 'a number'),
    ('gain', {}, False, 'False', 'a number'),
    ('channels', {}, True, 'True', 'a whole number'),
    ('channels', {}, 16.5, '16.5', 'a whole number'),
    ('channels', {}, '16', "'16'", 'a whole number'),
    ('exponent', {}, 2.5, '2.5', 'a whole number'),
    ('passband_hz', {}, 7, '7', 'a list'),
    ('passband_hz', {}, '7, 50', "'7, 50'", 'a list'),
    ('passband_hz', {}, (7, 20, 50), '3 numbers', '2'),
    ('passband_hz', {}, (), '0 numbers', '2'),
    ('passband_hz', {}, ('low', 50), "'low'", 'a number'),
    ('passband_hz', {}, (True, 50), 'True', 'a number'),
    ('stopbands_hz', {}, 50, '50', 'a list'),
    ('stopbands_hz', {}, (0.5, 7, 50), '3 numbers', 'pairs [low, high]'),
    ('stopbands_hz', {}, ('50-60',), "'50-60'", 'a number'),
    ('valid_range_v', {}, 5.0, '5.0', 'a list'),
    ('stopbands_hz', {}, (0.5, 7) * 33, '33 pairs', 'at most 32'),
    ('disabled_channels', {}, 3, '3', 'a list'),
    ('disabled_channels', {}, (2, 5, 2), '2 twice', 'each channel once'),
    ('threshold', {}, [1.0] * 1000, '1.0, 1...', 'a number'),
    ('disabled_channels', {}, (1.5,), '1.5', 'a whole number'),
    ('disabled_channels', {}, (True,), 'True', 'a whole number'),
    ('channel_names', {'channels': 2}, 'ab', "'ab'", 'a list'),
    ('groups', {}, [1, 2], '[1, 2]', 'a list of channel numbers per name'),
    ('groups', {}, None, 'None', 'a list of channel numbers per name'),
    ('groups.a', {}, {'a': '12'}, "'12'", 'a list of channel numbers'),
    ('groups.a', {}, {'a': 3}, '3', 'a list of channel numbers'),
    ('groups.a', {}, {'a': ['1']}, "'1'", 'a whole number'),
    ('groups.a', {}, {'a': [True]}, 'True', 'a whole number'),
    ('common_mode', {}, 3, '3', 'none, median, mean'),
    ('rectify', {}, None, 'None', 'full, half'),
    # Not a number, and too large for one.
    *(
        (name, {}, NAN, 'not a number', 'a number')
        for name in ('sample_rate_hz', 'gain', 'threshold', 'flat_after_s', 'envelope_window_s')
    ),
    ('passband_hz', {}, (NAN, 50), 'not a number', 'a number'),
    ('stopbands_hz', {}, (0.5, 7, NAN, 180), 'not a number', 'a number'),
    ('valid_range_v', {}, (NAN, 5), 'not a number', 'a number'),
    ('threshold', {}, 'nan', 'not a number', 'a number'),
    ('channels', {}, NAN, '', 'a whole number'),
    ('exponent', {}, INF, 'inf', ''),
    ('disabled_channels', {}, (NAN,), '', 'a whole number'),
    ('disabled_channels', {}, (INF,), 'inf', ''),
    ('groups.a', {}, {'a': [NAN]}, '', 'a whole number'),
    ('groups.a', {}, {'a': [INF]}, 'inf', ''),
    ('gain', {}, 10**400, '', ''),
    # Not one of the choices.
    ('common_mode', {}, 'average', "'average'", 'none, median, mean'),
    ('rectify', {}, 'both', "'both'", 'full, half'),
    *(
        ('vote', {}, value, repr(value), 'all, mean, or a whole number from 1')
        for value in ('any', '', 0, -1, 1.5, True, None, [1], '1.0', '²')
    ),
    # Band edges.
    ('passband_hz', {}, (50, 7), '50 and 7 Hz', 'the low edge first'),
    ('passband_hz', {}, (7, 7), '7 and 7 Hz', 'the low edge first'),
    ('passband_hz', {}, (7, 190), '190 Hz', '0.0038 Hz to below 190 Hz'),
    ('passband_hz', {}, (7, 500), '500 Hz', '0.0038 Hz to below 190 Hz'),
    ('passband_hz', {}, (200, 0), '200 Hz', '0.0038 Hz to below 190 Hz'),
    ('passband_hz', {}, (0, 50), '0 Hz', '0.0038 Hz to below 190 Hz'),
    ('passband_hz', {}, (0, 0), '0 Hz', '0.0038 Hz to below 190 Hz'),
    ('passband_hz', {}, (-7, 50), '-7 Hz', '0.0038 Hz to below 190 Hz'),
    ('passband_hz', {}, (7, -50), '-50 Hz', '0.0038 Hz to below 190 Hz'),
    ('passband_hz', {}, (0.003, 50), '0.003 Hz', '0.0038 Hz to below 190 Hz'),
    ('passband_hz', {}, (7, INF), 'inf Hz', '0.0038 Hz to below 190 Hz'),
    ('passband_hz', {'sample_rate_hz': 80}, (7, 50), '50 Hz', '0.0008 Hz to below 40 Hz'),
    ('stopbands_hz', {}, ((7, 0.5),), '7 and 0.5 Hz', 'the low edge first'),
    ('stopbands_hz', {}, ((1, 2), (50, 50)), '50 and 50 Hz', 'the low edge first'),
    ('stopbands_hz', {}, ((50, 190),), '190 Hz', '0.0038 Hz to below 190 Hz'),
    ('stopbands_hz', {}, ((50, 0),), '0 Hz', '0.0038 Hz to below 190 Hz'),
    ('stopbands_hz', {}, ((0.001, 7),), '0.001 Hz', '0.0038 Hz to below 190 Hz'),
    ('passband_degree', {}, 3, '3', 'an even number'),
    ('stopband_degree', {}, 5, '5', 'an even number'),
    # Channels and groups.
    ('disabled_channels', {}, (17,), '17', '1 to 16'),
    ('disabled_channels', {}, (0,), '0', '1 to 16'),
    ('disabled_channels', {}, (-1,), '-1', '1 to 16'),
    ('disabled_channels', {}, SIXTEEN, 'every channel', 'all but one'),
    ('groups.b', {'channels': 3}, {'a': [1, 2], 'b': [2, 3]}, 'channel 2', 'one group'),
    ('groups.a', {'channels': 2}, {'a': [1, 1, 2]}, 'channel 1', 'one group'),
    ('groups.a', {'channels': 2}, {'a': [1, 2, 3]}, 'channel 3', '1 to 2'),
    ('groups.a', {'channels': 2}, {'a': [0, 1, 2]}, 'channel 0', '1 to 2'),
    ('groups', {'channels': 3}, {'a': [1, 3]}, 'channel 2', 'one group or in disabled_channels'),
    ('groups.b', {'channels': 2}, {'a': [1, 2], 'b': []}, 'empty', 'at least one channel'),
    ('groups', {'channels': 1}, {'a b': [1]}, "'a b'", 'letters, digits and _, a letter first'),
    ('groups', {'channels': 1}, {'1a': [1]}, "'1a'", 'letters, digits and _, a letter first'),
    ('groups', {'channels': 1}, {'': [1]}, "''", 'letters, digits and _, a letter first'),
    ('groups', {'channels': 1}, {1: [1]}, '1', 'letters, digits and _, a letter first'),
    ('groups', {'channels': 1}, {'a\n': [1]}, r"'a\n'", 'letters, digits and _, a letter first'),
    ('vote', {}, 5, '5', 'at most 4, the enabled channels of group TP'),
    ('vote', {'channels': 3, 'groups': {'a': [1, 2], 'b': [3]}}, 2, '2', 'at most 1'),
    # Names.
    ('channel_names', {'channels': 2}, ('a', 'a'), "'a' twice", 'each name once'),
    ('channel_names', {'channels': 2}, ('a', 'b', 'c'), '3 names', '2, the number of channels'),
    ('channel_names', {'channels': 2}, ('a', ''), "''", 'letters, digits and _'),
    ('channel_names', {'channels': 2}, ('a', '2b'), "'2b'", 'letters, digits and _'),
    ('channel_names', {'channels': 2}, ('a', 'b/c'), "'b/c'", 'letters, digits and _'),
    ('channel_names', {'channels': 2}, ('a', 'ä'), "'ä'", 'letters, digits and _'),
    ('channel_names', {'channels': 2}, ('a', 7), '7', 'letters, digits and _'),
    # Windows and ranges.
    ('envelope_window_s', {}, 0.0, '0 s', 'at least one sample (0.00263158 s at 380 Hz)'),
    ('envelope_window_s', {}, 0.002, '0.002 s', 'at least one sample'),
    ('decision_window_s', {}, 0.0026, '0.0026 s', 'at least one sample'),
    ('valid_range_v', {}, (5, 0), '[5, 0] V', 'low below high'),
    ('valid_range_v', {}, (5, 5), '[5, 5] V', 'low below high'),
    ('valid_range_v', {}, (1, 2, 3), '3 numbers', '2'),
]


@pytest.mark.parametrize(
    ('name', 'others', 'value', 'shown', 'allowed_text'),
    REFUSED,
    ids=[f'{name}-{str(value)[:30]!r}' for name, _, value, _, _ in REFUSED],
)
def test_a_bad_value_is_an_error_that_names_parameter_value_and_what_is_allowed(
    name, others, value, shown, allowed_text
):
    field = name.partition('.')[0]
    message = message_of(ChainConfig, **others, **{field: value})
    before, comma, after = message.partition(', allowed: ')
    assert re.match(rf'parameter {re.escape(name)}\b', before)
    assert comma
    assert shown in before
    assert allowed_text in after
    # The same through ROS names, with what it came from in front.
    parameters = others | {field: value}
    if all(isinstance(key, str) for key in parameters.get('groups') or {}):
        lead = message_of(ChainConfig.from_parameters, parameters, 'here.yaml')
        assert lead == f'here.yaml: {message}'


@pytest.mark.parametrize('rate', [1.0, 100.0, 380.0, 1e6])
def test_edges_are_allowed_down_to_their_share_of_the_rate_and_below_nyquist(rate):
    def build(low, high):
        window = 2 / rate
        return ChainConfig(
            sample_rate_hz=rate, passband_hz=(low, high), stopbands_hz=(),
            envelope_window_s=window, decision_window_s=window,
        )  # fmt: skip

    low, high = LOWEST_EDGE * rate, math.nextafter(rate / 2, 0)
    assert build(low, high).passband_hz == (low, high)
    assert 'passband_hz' in message_of(build, low * (1 - 1e-9), high)
    assert 'passband_hz' in message_of(build, low, rate / 2)


def test_the_lowest_edge_may_be_written_as_it_is_said():
    # 1e-5 * 380 is a last digit above 0.0038.
    for rate, low in ((380.0, 0.0038), (100.0, 0.001), (1000.0, 0.01)):
        assert ChainConfig(sample_rate_hz=rate, passband_hz=(low, rate / 4), stopbands_hz=())


def test_a_window_of_exactly_one_sample_is_allowed():
    for rate in (1.0, 3.0, 380.0, 2012.5, 1e6):
        config = ChainConfig(
            sample_rate_hz=rate,
            passband_hz=(0.1 * rate, 0.0),
            stopbands_hz=(),
            envelope_window_s=1 / rate,
            decision_window_s=1 / rate,
        )
        assert config.samples(config.envelope_window_s) == 1


def test_a_group_must_keep_the_channels_that_its_vote_takes():
    message = message_of(ChainConfig, disabled_channels=(14, 16), vote=3)
    assert message.endswith('allowed: at most 2, the enabled channels of group TP')


@pytest.mark.parametrize(
    ('seconds', 'samples'), [(0.0, 1), (0.001, 1), (0.0149, 1), (0.0151, 2), (1.0, 100)]
)
def test_a_time_is_rounded_to_samples_and_at_least_one(seconds, samples):
    assert ChainConfig(sample_rate_hz=100.0, stopbands_hz=(), passband_hz=(7, 45)).samples(
        seconds
    ) == pytest.approx(samples, abs=0)


@pytest.mark.parametrize(
    ('channels', 'value', 'shown', 'allowed_text'),
    [
        (16, (0.0,) * 47, '47 numbers', '48, three for each channel, or none'),
        (1, (0.0,) * 48, '48 numbers', '3, three for each channel, or none'),
        (1, (0.0, 0.0, 10.5), '10.5 m', 'three numbers a channel, -10 to 10'),
        (1, (0.0, NAN, 0.0), 'not a number', 'a number'),
        (1, (0.0, 'left', 0.0), "'left'", 'a number'),
        (1, 0.001, '0.001', 'a list'),
    ],
)
def test_each_channel_has_three_numbers_for_its_place_or_none_has(
    channels, value, shown, allowed_text
):
    message = message_of(DetectorConfig, channels=channels, taxel_positions_m=value)
    before, _, after = message.partition(', allowed: ')
    assert before.startswith('parameter taxel_positions_m ')
    assert shown in before
    assert allowed_text in after


def test_places_survive_the_way_through_a_file(tmp_path):
    config = DetectorConfig(channels=2, taxel_positions_m=(-1e-3, 0, 2.5e-4, 1e-3, 0, 0))
    path = tmp_path / 'finger.yaml'
    path.write_text(config.to_yaml())
    assert DetectorConfig.from_yaml(path) == config
    # What runs recordings needs no places, and reads the same file.
    assert ChainConfig.from_yaml(path).channels == 2
