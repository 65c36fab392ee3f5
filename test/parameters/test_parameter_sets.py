"""Sets of parameters: types, messages, YAML in and out."""

import dataclasses
import re
import tempfile
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.parameters.sets import allowed, default_of, read_parameter_file
from support.config_cases import SETS, message_of


@pytest.mark.parametrize(
    ('seconds', 'samples'), [(0.0, 1), (0.001, 1), (0.0149, 1), (0.0151, 2), (1.0, 100)]
)
def test_a_time_is_rounded_to_samples_and_at_least_one(seconds, samples):
    assert ChainConfig(sample_rate_hz=100.0, stopbands_hz=(), passband_hz=(7, 45)).samples(
        seconds
    ) == pytest.approx(samples, abs=0)


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
