"""The README says what is true."""

import re

from readme_tables import README, with_tables

from slip_detector.config import ChainConfig

ROOT = README.parent


def test_the_parameter_tables_are_those_of_the_dataclasses():
    assert with_tables(README.read_text()) == README.read_text(), (
        'run python test/readme_tables.py'
    )


def test_every_picture_and_file_it_names_is_there():
    text = README.read_text()
    named = re.findall(r'\]\(([^)#:]+)\)', text)
    named += re.findall(r'`((?:config|slip_detector|test|docs)/[\w/]+\.\w+)`', text)
    assert named
    for path in named:
        assert (ROOT / path).is_file(), path


def test_the_example_of_an_own_sensor_is_a_configuration_that_works():
    (example,) = re.findall(r'```yaml\n(.*?)```', README.read_text(), re.S)
    path = ROOT / 'README.md'
    import yaml

    from slip_detector.chain import SlipChain

    parameters = yaml.safe_load(example)['/**/slip_detector']['ros__parameters']
    groups = parameters.pop('groups')
    parameters.update({f'groups.{name}': members for name, members in groups.items()})
    config = ChainConfig.from_parameters(parameters, str(path))
    assert list(config.groups) == ['left', 'right']
    SlipChain(config)
