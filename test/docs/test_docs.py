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

"""README and docs say what is true."""

import pkgutil
import re

import numpy as np
import pytest
import yaml

from slip_detector.parameters.sections import set_of
from slip_detector.recordings.labels import read_labels
from slip_detector.scenes import load_scene
from support.pages import DOCS, PAGES, README, ROOT, blocks, file_name, identifier
from support.parameter_tables import TABLES, with_tables

SCENES = DOCS / 'scenes.md'

#: Roots of what pages name as code.
FOLDERS = 'config|slip_detector|test|docs|benchmarks|examples|launch'


def files_shown():
    """Yield each file that a page shows."""
    for path in PAGES:
        for block in blocks(path):
            if block.language == 'yaml':
                where = f'{identifier(path)}:{block.line}'
                yield pytest.param(file_name(block), block.text, id=where)


def anchors(path):
    """Return the anchors of the headings of a page, as GitHub makes them."""
    headings = re.findall(r'^#+ (.*)$', path.read_text(encoding='utf-8'), re.M)
    return {re.sub(r'[^\w -]', '', heading.lower()).replace(' ', '-') for heading in headings}


def test_the_readme_is_short():
    assert len(README.read_bytes()) <= 10_000


@pytest.mark.parametrize('path', TABLES, ids=lambda path: path.name)
def test_the_parameter_tables_are_those_of_the_dataclasses(path):
    assert with_tables(path) == path.read_text(encoding='utf-8'), (
        'run python test/support/parameter_tables.py'
    )


@pytest.mark.parametrize('path', PAGES, ids=identifier)
def test_every_file_and_heading_that_it_names_is_there(path):
    text = path.read_text(encoding='utf-8')
    for name, anchor in re.findall(r'\]\((?!https?:)([^)#]*)#?([^)]*)\)', text):
        linked = path.parent / name if name else path
        assert linked.exists(), name
        assert not anchor or anchor in anchors(linked), f'{name}#{anchor}'
    for name in re.findall(rf'`((?:{FOLDERS})/(?:[^`\s<]*[./][^`\s<]*)?)`', text):
        assert (ROOT / name).exists(), name
    for name in re.findall(r'`(slip_detector(?!\.launch)(?:\.\w+)+)`', text):
        pkgutil.resolve_name(name)


def test_every_page_example_and_picture_is_listed():
    indexes = DOCS / 'README.md', DOCS / 'verification' / 'README.md', ROOT / 'CONTRIBUTING.md'
    text = ''.join(path.read_text(encoding='utf-8') for path in indexes)
    linked = {name.rsplit('/', 1)[-1] for name in re.findall(r'\(([\w/.]+)\)', text)}
    assert {path.name for path in DOCS.rglob('*.md') if path.name != 'README.md'} <= linked
    assert {path.name for path in (ROOT / 'examples').iterdir() if path.is_file()} <= linked
    assert {path.name for path in (DOCS / 'figures').iterdir()} <= {*re.findall('`(.*?)`', text)}


@pytest.mark.parametrize(('name', 'text'), list(files_shown()))
def test_every_file_that_is_shown_is_a_good_one(name, text, tmp_path):
    assert name, 'its first line is to be its name: # NAME.yaml'
    file = tmp_path / name
    file.write_text(text, encoding='utf-8')
    content = yaml.safe_load(text)
    if 'steps' in content:
        scene = load_scene(file, np.random.default_rng(0))
        assert scene.read(10_000).truth.any() == (name != 'rest.yaml')
    elif 'slip_s' in content:
        read_labels(file)
    else:
        for section, parameters in content.items():
            file.write_text(yaml.safe_dump({section: parameters}), encoding='utf-8')
            set_of(section.rpartition('/')[2]).from_yaml(file)


def test_the_options_of_the_live_page_are_those_of_its_command():
    text = (DOCS / 'live_page.md').read_text(encoding='utf-8')
    rows = dict(re.findall(r'^\| `(--[\w-]+)` \| `?(.*?)`? \|', text, re.M))
    view_options = pytest.importorskip('slip_detector.nodes.view')._parser
    options = {
        action.option_strings[-1]: action.default
        for action in view_options()._actions
        if action.option_strings and action.dest != 'help'
    }
    assert list(rows) == list(options)
    for name, default in options.items():
        if default:
            assert rows[name] == str(default)


def test_every_scene_that_comes_with_the_package_is_described():
    shipped = sorted(path.stem for path in (ROOT / 'config' / 'scenes').glob('*.yaml'))
    (listed,) = re.findall(
        r'## What comes with the package\n(.*?)\n## ', SCENES.read_text(encoding='utf-8'), re.S
    )
    assert sorted(re.findall(r'^\| `(\w+)` \|', listed, re.M)) == shipped


def test_lines_of_parameter_files_have_at_most_99_columns_but_commands():
    files = (ROOT / 'config').rglob('*.yaml')
    lines = (line for path in files for line in path.read_text(encoding='utf-8').splitlines())
    assert [line for line in lines if len(line) > 99 and ' ros2 launch ' not in line] == []
