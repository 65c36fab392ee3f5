"""README and docs say what is true."""

import re

import numpy as np
import pytest
import yaml

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig
from slip_detector.scenes import Scene
from slip_detector.scenes.parts import PARTS
from support.parameter_tables import DOCUMENTS, ROOT, table, with_tables

README, SCENES = ROOT / 'README.md', ROOT / 'docs' / 'scenes.md'
PAGES = [README, *sorted((ROOT / 'docs').glob('*.md'))]


def examples(path):
    return [
        yaml.safe_load(text) for text in re.findall(r'```yaml\n(.*?)```', path.read_text(), re.S)
    ]


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda path: path.name)
def test_the_parameter_tables_are_those_of_the_dataclasses(path):
    assert with_tables(path) == path.read_text(), 'run python test/parameter_tables.py'


def test_each_part_of_a_scene_has_its_table():
    text = SCENES.read_text()
    for name, part in PARTS.items():
        assert f'### `{name}`\n\n<!-- {part.__name__} -->\n{table(part)}\n' in text


@pytest.mark.parametrize('path', PAGES, ids=lambda path: path.name)
def test_every_picture_and_file_it_names_is_there(path):
    text = path.read_text()
    linked = [path.parent / name for name in re.findall(r'\]\(([^)#:]+)\)', text)]
    named = re.findall(r'`((?:config|slip_detector|test|docs)/[\w/]+\.\w+)`', text)
    for file in [*linked, *(ROOT / name for name in named)]:
        assert file.is_file(), file


def test_the_example_of_an_own_sensor_is_a_configuration_that_works():
    (section,) = (
        example['/**/slip_detector']
        for example in examples(README)
        if '/**/slip_detector' in example
    )
    parameters = section['ros__parameters']
    groups = parameters.pop('groups')
    parameters.update({f'groups.{name}': members for name, members in groups.items()})
    config = ChainConfig.from_parameters(parameters, str(README))
    assert list(config.groups) == ['left', 'right']
    SlipChain(config)


@pytest.mark.parametrize('path', [README, SCENES], ids=lambda path: path.name)
def test_the_examples_of_a_scene_are_scenes_that_slip(path):
    scenes = [example for example in examples(path) if 'steps' in example]
    assert scenes
    for example in scenes:
        samples = Scene(example, np.random.default_rng(0)).read(10**6)
        assert samples.truth.any()


def test_every_scene_that_comes_with_the_package_is_described():
    shipped = sorted(path.stem for path in (ROOT / 'config' / 'scenes').glob('*.yaml'))
    (listed,) = re.findall(r'## What comes with the package\n(.*?)\n## ', SCENES.read_text(), re.S)
    assert sorted(re.findall(r'^\| `(\w+)` \|', listed, re.M)) == shipped
