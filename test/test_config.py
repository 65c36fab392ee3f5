"""Parameters: the paper's defaults, what is refused and in which words, and YAML."""

import dataclasses
import math
import re
import tempfile
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.config import (
    LOWEST_EDGE,
    ChainConfig,
    DetectorConfig,
    DriverConfig,
    EvaluationConfig,
)
from slip_detector.parameter_sets import allowed, default_of, read_parameter_file

SETS = (ChainConfig, DetectorConfig, DriverConfig, EvaluationConfig)

NAN, INF = math.nan, math.inf


def message_of(build, *args, **values):
    """Return the text of the ValueError, which is one line."""
    with pytest.raises(ValueError, match=r'\S') as caught:
        build(*args, **values)
    # Not one of its children, such as a UnicodeDecodeError.
    assert type(caught.value) is ValueError
    message = str(caught.value)
    assert '\n' not in message
    return message


# --- defaults ------------------------------------------------------------------------------

PAPER = {
    'sample_rate_hz': 380.0,
    'channels': 16,
    'disabled_channels': (),
    'common_mode': 'none',
    'passband_hz': (7.0, 50.0),
    'passband_degree': 4,
    'gain': 100.0,
    'stopbands_hz': ((0.5, 7.0), (50.0, 180.0)),
    'stopband_degree': 4,
    'stopband_ripple_db': 0.01,
    'stopband_attenuation_db': 40.0,
    'rectify': 'full',
    'exponent': 3,
    'envelope_window_s': 0.04,
    'decision_window_s': 0.04,
    'threshold': 0.5,
    'vote': 'all',
    'groups': {
        'TP': (14, 16, 11, 9),
        'TD': (1, 3, 8, 6),
        'LR': (5, 7, 12, 10),
        'LU': (2, 4, 15, 13),
    },
}


@pytest.mark.parametrize('name', PAPER)
@pytest.mark.parametrize('kind', [ChainConfig, DetectorConfig])
def test_the_defaults_are_the_papers(kind, name):
    assert getattr(kind(), name) == PAPER[name]


def test_the_papers_windows_are_15_samples():
    config = ChainConfig()
    assert config.samples(config.envelope_window_s) == 15
    assert config.samples(config.decision_window_s) == 15


@pytest.mark.parametrize(
    ('seconds', 'samples'), [(0.0, 1), (0.001, 1), (0.0149, 1), (0.0151, 2), (1.0, 100)]
)
def test_a_time_is_rounded_to_samples_and_at_least_one(seconds, samples):
    assert ChainConfig(sample_rate_hz=100.0, stopbands_hz=(), passband_hz=(7, 45)).samples(
        seconds
    ) == pytest.approx(samples, abs=0)


@pytest.mark.parametrize('kind', SETS)
def test_every_parameter_is_described_and_its_default_allowed(kind):
    for field in dataclasses.fields(kind):
        assert re.fullmatch(r'[a-z][a-z0-9_]*', field.name)
        meaning = field.metadata['meaning']
        assert meaning.endswith(('.', ')')), field.name
        assert len(meaning) < 160, field.name
        choices = field.metadata['choices']
        assert not choices or default_of(field) in choices
        for suffix, unit in (('_hz', 'Hz'), ('_s', 's'), ('_v', 'V'), ('_db', 'dB')):
            if field.name.endswith(suffix):
                assert field.metadata['unit'] == unit, field.name
    assert kind() == kind()


def test_names_are_ch1_and_on_unless_given():
    assert ChainConfig(channels=3).names == ('ch1', 'ch2', 'ch3')
    assert ChainConfig(channels=2, channel_names=('left', 'right')).names == ('left', 'right')


def test_groups_are_table_1_for_16_channels_and_one_for_any_other_number():
    assert list(ChainConfig().groups) == ['TP', 'TD', 'LR', 'LU']
    assert ChainConfig(channels=5).groups == {'all': (1, 2, 3, 4, 5)}


def test_default_groups_leave_out_disabled_channels_and_emptied_groups():
    config = ChainConfig(disabled_channels=(14, 1, 3, 8, 6))
    assert config.groups == {
        'TP': (16, 11, 9),
        'LR': (5, 7, 12, 10),
        'LU': (2, 4, 15, 13),
    }
    assert ChainConfig(channels=3, disabled_channels=[2]).groups == {'all': (1, 3)}


@pytest.mark.parametrize('kind', SETS)
def test_a_set_of_parameters_cannot_be_changed(kind):
    config = kind()
    for field in dataclasses.fields(kind):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(config, field.name, default_of(field))


def test_a_changed_copy_is_checked_too():
    config = ChainConfig()
    assert dataclasses.replace(config, threshold=2.0).threshold == 2.0
    assert 'threshold' in message_of(dataclasses.replace, config, threshold=-2.0)


def test_the_default_of_groups_is_not_shared():
    field = next(f for f in dataclasses.fields(ChainConfig) if f.name == 'groups')
    default_of(field)['mine'] = (1,)
    assert 'mine' not in default_of(field)
    assert 'mine' not in ChainConfig().groups


# --- conversion ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('values', 'name', 'expected'),
    [
        ({'sample_rate_hz': 400}, 'sample_rate_hz', 400.0),
        ({'gain': 5}, 'gain', 5.0),
        ({'threshold': 1}, 'threshold', 1.0),
        ({'threshold': '1e9'}, 'threshold', 1e9),
        ({'valid_range_v': ['-1e9', '1e9']}, 'valid_range_v', (-1e9, 1e9)),
        ({'valid_range_v': [0, 5]}, 'valid_range_v', (0.0, 5.0)),
        ({'passband_hz': [10, 150]}, 'passband_hz', (10.0, 150.0)),
        ({'passband_hz': [10, 0]}, 'passband_hz', (10.0, 0.0)),
        ({'stopbands_hz': [1, 2, 48, 52]}, 'stopbands_hz', ((1.0, 2.0), (48.0, 52.0))),
        ({'stopbands_hz': [[1, 2], [48, 52]]}, 'stopbands_hz', ((1.0, 2.0), (48.0, 52.0))),
        ({'stopbands_hz': []}, 'stopbands_hz', ()),
        ({'channels': 8.0}, 'channels', 8),
        ({'exponent': 2.0}, 'exponent', 2),
        ({'disabled_channels': [3, 1]}, 'disabled_channels', (3, 1)),
        ({'vote': 3}, 'vote', 3),
        ({'vote': '3'}, 'vote', 3),
        ({'vote': 'mean'}, 'vote', 'mean'),
        ({'groups': {'a': [1, 2]}, 'channels': 2}, 'groups', {'a': (1, 2)}),
        ({'groups': {'a': (1.0, 2.0)}, 'channels': 2}, 'groups', {'a': (1, 2)}),
    ],
)
def test_values_are_brought_to_the_parameters_type(values, name, expected):
    value = getattr(ChainConfig(**values), name)
    assert value == expected
    assert type(value) is type(expected)
    if isinstance(expected, tuple):
        assert [type(item) for item in value] == [type(item) for item in expected]


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
    ('disabled_channels', {}, 3, '3', 'a list'),
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


@pytest.mark.parametrize(
    ('name', 'hint'),
    [
        ('treshold', 'did you mean threshold?'),
        ('passband', 'did you mean passband_hz?'),
        ('envelope_window', 'did you mean envelope_window_s?'),
        ('stopband_hz', 'did you mean stopbands_hz?'),
        ('Gain', 'did you mean gain?'),
        ('zzz', 'allowed: channel_names, channels, common_mode'),
        ('threshold.a', 'did you mean threshold?'),
    ],
)
def test_an_unknown_parameter_is_an_error_that_suggests_a_near_name(name, hint):
    message = message_of(ChainConfig.from_parameters, {'gain': 1.0, name: 0.7}, 'a.yaml')
    assert message.startswith(f'a.yaml: unknown parameter {name} = 0.7; ')
    assert hint in message


def test_from_parameters_takes_nested_names():
    config = ChainConfig.from_parameters(
        {'channels': 3, 'groups.left': [1, 3], 'groups.right': [2], 'vote': 1}
    )
    assert config.groups == {'left': (1, 3), 'right': (2,)}


def test_a_message_without_a_file_leads_with_the_parameter():
    assert message_of(ChainConfig.from_parameters, {'gain': 0}).startswith('parameter gain is 0')


@given(st.floats())
def test_any_float_is_taken_or_refused_in_one_line(value):
    for field in dataclasses.fields(DetectorConfig):
        if type(default_of(field)) is not float:
            continue
        low, high = field.metadata['low'], field.metadata['high']
        if not low <= value <= high:
            message = message_of(DetectorConfig, **{field.name: value})
            assert re.fullmatch(rf'parameter {field.name} .+, allowed: .+', message)
            continue
        try:
            config = DetectorConfig(**{field.name: value})
        except ValueError as error:
            # Allowed on its own, not with the others: edges against the rate, windows too.
            message = str(error)
            config = None
        if config is None:
            assert field.name in ('sample_rate_hz', 'envelope_window_s', 'decision_window_s')
            assert re.fullmatch(r'parameter \w+ .+, allowed: .+', message)
        else:
            assert getattr(config, field.name) == value


def test_allowed_says_the_range_the_choices_or_nothing():
    fields = {field.name: field for field in dataclasses.fields(DriverConfig)}
    chain = {field.name: field for field in dataclasses.fields(ChainConfig)}
    assert allowed(chain['sample_rate_hz']) == '1 to 1e+06 Hz'
    assert allowed(chain['rectify']) == 'full, half'
    assert allowed(fields['frame_id']) == ''


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


# --- YAML ----------------------------------------------------------------------------------


@st.composite
def chain_values(draw):
    rate = draw(st.floats(1.0, 1e6))
    channels = draw(st.integers(1, 20))
    order = draw(st.permutations(range(1, channels + 1)))
    enabled = order[: draw(st.integers(1, channels))]
    n_groups = draw(st.integers(1, min(3, len(enabled))))
    names = st.from_regex(r'[A-Za-z][A-Za-z0-9_]{0,8}', fullmatch=True)
    # Words that YAML takes for something else.
    words = st.sampled_from(['on', 'no', 'null', 'true', 'y', 'NaN', 'e1', 'all'])
    labels = draw(
        st.lists(st.one_of(names, words), min_size=n_groups, max_size=n_groups, unique=True)
    )
    groups = {label: enabled[i::n_groups] for i, label in enumerate(labels)}
    few = min(len(members) for members in groups.values())
    shares = st.floats(2e-5, 0.24)
    low = draw(shares) * rate
    high_pass = draw(st.booleans())
    stopbands = [(a * rate, (a + b) * rate) for a, b in draw(st.lists(st.tuples(shares, shares)))]
    windows = st.floats(1.001, 50.0).map(lambda samples: min(samples / rate, 60.0))
    return {
        'sample_rate_hz': rate,
        'channels': channels,
        'channel_names': draw(
            st.one_of(
                st.just([]),
                st.lists(
                    st.one_of(names, words), min_size=channels, max_size=channels, unique=True
                ),
            )
        ),
        'disabled_channels': order[len(enabled) :],
        'valid_range_v': (draw(st.floats(-1e12, -1e-300)), draw(st.floats(0, 1e12))),
        'flat_after_s': draw(st.floats(0, 3600)),
        'common_mode': draw(st.sampled_from(['none', 'mean', 'median'])),
        'passband_hz': (low, 0.0 if high_pass else low + draw(shares) * rate),
        'passband_degree': draw(st.integers(1, 10)) * (1 if high_pass else 2),
        'gain': draw(st.floats(1e-6, 1e6)),
        'stopbands_hz': stopbands,
        'stopband_degree': 2 * draw(st.integers(1, 10)),
        'stopband_ripple_db': draw(st.floats(1e-4, 3)),
        'stopband_attenuation_db': draw(st.floats(6, 120)),
        'rectify': draw(st.sampled_from(['full', 'half'])),
        'exponent': draw(st.integers(1, 6)),
        'envelope_window_s': draw(windows),
        'decision_window_s': draw(windows),
        'threshold': draw(st.floats(1e-30, 1e30)),
        'vote': draw(st.one_of(st.sampled_from(['all', 'mean']), st.integers(1, few))),
        'groups': groups,
    }


def read_back(config):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'parameters.yaml'
        path.write_text(config.to_yaml(), encoding='utf-8')
        return type(config).from_yaml(path)


@given(chain_values())
def test_a_chain_written_to_yaml_reads_back_equal(values):
    config = ChainConfig(**values)
    assert read_back(config) == config
    assert list(read_back(config).groups) == list(config.groups)
    assert ChainConfig.from_parameters(config.to_parameters()) == config


@given(
    chain_values(),
    st.fixed_dictionaries(
        {
            'max_gap_s': st.floats(0, 60),
            'input_timeout_s': st.floats(0.01, 3600),
            'heartbeat_hz': st.floats(0.1, 1000),
            'publish_groups': st.booleans(),
            'publish_channels': st.booleans(),
        }
    ),
)
def test_a_detector_written_to_yaml_reads_back_equal(values, more):
    config = DetectorConfig(**values, **more)
    assert read_back(config) == config


@given(
    st.fixed_dictionaries(
        {
            'source': st.sampled_from(['scene', 'recording']),
            'scene': st.text(),
            'seed': st.integers(0, 2**31 - 1),
            'recording': st.text(min_size=1),
            'rate': st.floats(0.001, 1000),
            'loop': st.booleans(),
            'frame_id': st.one_of(st.text(), st.sampled_from(['1e9', 'on', 'null', '~', '0x1'])),
        }
    )
)
def test_a_driver_written_to_yaml_reads_back_equal(values):
    config = DriverConfig(**values)
    assert read_back(config) == config


@pytest.mark.parametrize('kind', SETS)
def test_the_defaults_written_to_yaml_are_a_ros_parameter_file(kind):
    assert read_back(kind()) == kind()
    document = yaml.safe_load(kind().to_yaml())
    assert list(document) == [f'/**/{kind.NODE}']
    parameters = document[f'/**/{kind.NODE}']['ros__parameters']
    assert list(parameters) == [field.name for field in dataclasses.fields(kind)]
    # ROS takes numbers, text, booleans, and flat lists of one type.
    for name, value in kind().to_parameters().items():
        items = value if isinstance(value, list) else [value]
        assert len({type(item) for item in items}) <= 1, name
        assert all(isinstance(item, (bool, int, float, str)) for item in items), name


def test_to_parameters_gives_flat_lists_and_nested_names():
    parameters = ChainConfig().to_parameters()
    assert parameters['stopbands_hz'] == [0.5, 7.0, 50.0, 180.0]
    assert parameters['groups.TP'] == [14, 16, 11, 9]
    assert 'groups' not in parameters


@pytest.fixture
def write(tmp_path):
    def to_file(text):
        path = tmp_path / 'finger.yaml'
        path.write_text(text, encoding='utf-8')
        return path

    return to_file


@pytest.mark.parametrize(
    'section',
    ['slip_detector', '/slip_detector', '/left/slip_detector', '/**/slip_detector', '/**'],
)
def test_the_nodes_section_is_read_in_any_namespace(write, section):
    path = write(f'{section}:\n  ros__parameters:\n    threshold: 0.7\n')
    assert ChainConfig.from_yaml(path) == ChainConfig(threshold=0.7)
    assert DetectorConfig.from_yaml(str(path)) == DetectorConfig(threshold=0.7)


def test_sections_of_other_nodes_are_ignored_and_common_ones_count(write):
    path = write(
        """
        slip_driver:
          ros__parameters: {seed: 3, loop: true}
        /**:
          ros__parameters: {channels: 2}
        my_slip_detector:
          ros__parameters: {threshold: nonsense}
        /finger/slip_detector:
          ros__parameters:
            threshold: 0.9
            groups: {left: [1], right: [2]}
        """
    )
    assert ChainConfig.from_yaml(path) == ChainConfig(
        channels=2, threshold=0.9, groups={'left': [1], 'right': [2]}
    )
    assert read_parameter_file(path, 'slip_detector') == {
        'channels': 2,
        'threshold': 0.9,
        'groups.left': [1],
        'groups.right': [2],
    }
    assert read_parameter_file(path, 'grasp_controller') == {'channels': 2}


def test_a_file_without_a_section_for_the_node_gives_the_defaults(write):
    path = write('slip_driver:\n  ros__parameters:\n    seed: 3\n')
    assert ChainConfig.from_yaml(path) == ChainConfig()
    assert DriverConfig.from_yaml(path) == DriverConfig(seed=3)


def test_numbers_that_yaml_reads_as_text_are_taken(write):
    path = write(
        'slip_detector:\n  ros__parameters:\n'
        '    valid_range_v: [-1e9, 1e9]\n    threshold: 1e3\n    sample_rate_hz: 400\n'
    )
    config = ChainConfig.from_yaml(path)
    assert config.valid_range_v == (-1e9, 1e9)
    assert config.threshold == 1000.0
    assert config.sample_rate_hz == 400.0


def test_a_chain_is_read_from_a_section_with_the_nodes_own_parameters(write):
    path = write(
        'slip_detector:\n  ros__parameters:\n'
        '    gain: 3.0\n    heartbeat_hz: 5.0\n    publish_groups: false\n'
    )
    assert ChainConfig.from_yaml(path) == ChainConfig(gain=3.0)
    assert type(ChainConfig.from_yaml(path)) is ChainConfig
    assert DetectorConfig.from_yaml(path) == DetectorConfig(
        gain=3.0, heartbeat_hz=5.0, publish_groups=False
    )


@pytest.mark.parametrize(
    ('line', 'start'),
    [
        ('gain: -1', 'parameter gain is -1'),
        ('heartbeat_hz: 0', 'parameter heartbeat_hz is 0 Hz'),
        ('publish_groups: 1', 'parameter publish_groups is 1'),
        ('heart_beat_hz: 5', 'unknown parameter heart_beat_hz = 5; did you mean heartbeat_hz?'),
        ('groups: {TP: [1, 2]}', 'parameter groups leaves out channel 3'),
    ],
)
@pytest.mark.parametrize('kind', [ChainConfig, DetectorConfig])
def test_a_bad_value_in_a_file_is_an_error_that_names_the_file(write, kind, line, start):
    path = write(f'slip_detector:\n  ros__parameters:\n    {line}\n')
    assert message_of(kind.from_yaml, path).startswith(f'{path}: {start}')


@pytest.mark.parametrize(
    ('content', 'says'),
    [
        (b'slip_detector: [1, 2\n', 'line 2 is not YAML'),
        (b'a: b: c\n', 'line 1 is not YAML'),
        (b'a: 1\n\tb: 2\n', 'line 2 is not YAML'),
        (b'a: !!python/object:os.system {}\n', 'line 1 is not YAML'),
        (b'\xff\xfe\x00slip', 'is not text'),
        (b'a: \x01\n', 'is not YAML'),
        (b'a: 1\n---\nb: 2\n', 'is not YAML'),
        (b'', 'is not a'),
        (b'- 1\n- 2\n', 'is not a'),
        (b'just text\n', 'is not a'),
        (b'slip_detector:\n  threshold: 0.7\n', 'slip_detector/threshold has no ros__parameters'),
        (b'slip_detector:\n  ros__parameters:\n', 'slip_detector has no names under ros__'),
        (b'slip_detector:\n  ros__parameters: [1]\n', 'slip_detector has no names under ros__'),
        (b'slip_detector:\n', 'slip_detector has no ros__parameters'),
        (b'threshold: 0.7\n', 'threshold has no ros__parameters'),
    ],
)
@pytest.mark.parametrize('kind', SETS)
def test_a_file_of_another_kind_is_an_error_that_names_it(tmp_path, kind, content, says):
    path = tmp_path / 'finger.yaml'
    path.write_bytes(content)
    message = message_of(kind.from_yaml, path)
    assert message.startswith(f'{path}:')
    assert says in message


@pytest.mark.parametrize('kind', SETS)
def test_a_file_that_cannot_be_opened_is_an_error_that_names_it(tmp_path, kind):
    for path in (tmp_path / 'missing.yaml', tmp_path):
        message = message_of(kind.from_yaml, path)
        assert message.startswith(f'{path}: cannot be read (')


# --- the driver ----------------------------------------------------------------------------


def test_the_driver_plays_a_scene_unless_told():
    config = DriverConfig()
    assert (config.source, config.seed, config.rate, config.loop) == ('scene', 0, 1.0, False)
    assert DriverConfig(source='recording', recording='trial.npz').recording == 'trial.npz'


@pytest.mark.parametrize(
    ('name', 'value', 'shown', 'allowed_text'),
    [
        ('source', 'camera', "'camera'", 'scene, recording'),
        ('source', None, 'None', 'scene, recording'),
        ('scene', 3, '3', 'text'),
        ('seed', -1, '-1', '0 to 2.14748e+09'),
        ('seed', 2**31, '2.14748e+09', '0 to 2.14748e+09'),
        ('seed', 0.5, '0.5', 'a whole number'),
        ('seed', True, 'True', 'a whole number'),
        ('rate', 0, '0', '0.001 to 1000'),
        ('rate', NAN, 'not a number', 'a number'),
        ('rate', INF, 'inf', '0.001 to 1000'),
        ('loop', 1, '1', 'true, false'),
        ('loop', 'true', "'true'", 'true, false'),
        ('frame_id', None, 'None', 'text'),
    ],
)
def test_a_bad_value_of_the_driver_is_an_error(name, value, shown, allowed_text):
    before, comma, after = message_of(DriverConfig, **{name: value}).partition(', allowed: ')
    assert before.startswith(f'parameter {name} ')
    assert comma
    assert shown in before
    assert allowed_text in after


def test_a_driver_does_not_take_the_chains_parameters():
    message = message_of(DriverConfig.from_parameters, {'threshold': 0.5})
    assert message.startswith('unknown parameter threshold = 0.5; ')


def test_what_rclpy_reads_itself_may_stand_in_the_file(tmp_path):
    path = tmp_path / 'finger.yaml'
    path.write_text(
        '/**:\n  ros__parameters: {use_sim_time: true}\n'
        '/**/slip_detector:\n'
        '  ros__parameters:\n'
        '    qos_overrides: {/slip: {publisher: {depth: 3}}}\n'
        '    gain: 3.0\n'
    )
    assert ChainConfig.from_yaml(path) == ChainConfig(gain=3.0)


def test_a_node_may_stand_nested_in_its_namespace(tmp_path):
    path = tmp_path / 'finger.yaml'
    path.write_text('left:\n  index:\n    slip_detector:\n      ros__parameters: {gain: 3.0}\n')
    assert ChainConfig.from_yaml(path) == ChainConfig(gain=3.0)


def test_a_node_in_several_namespaces_is_not_guessed(tmp_path):
    path = tmp_path / 'hand.yaml'
    path.write_text(
        '/left/slip_detector:\n  ros__parameters: {gain: 3.0}\n'
        '/right/slip_detector:\n  ros__parameters: {gain: 4.0}\n'
    )
    message = message_of(ChainConfig.from_yaml, path)
    assert '/left/slip_detector, /right/slip_detector' in message


def test_a_file_for_other_packages_is_refused(tmp_path):
    path = tmp_path / 'camera.yaml'
    path.write_text('/camera:\n  ros__parameters: {gain: 3.0}\n')
    message = message_of(ChainConfig.from_yaml, path)
    assert message.startswith(f'{path}: has no section of this package')


def test_a_group_must_keep_the_channels_that_its_vote_takes():
    message = message_of(ChainConfig, disabled_channels=(14, 16), vote=3)
    assert message.endswith('allowed: at most 2, the enabled channels of group TP')
