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

"""The rooms of the package, read off its imports."""

import ast
import functools
import re
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE, BENCHMARKS = ROOT / 'slip_detector', ROOT / 'benchmarks'

#: From which rooms each imports, as CONTRIBUTING.md says.
ARROWS = {
    room: set(re.findall(r'`(\w+)`', arrows))
    for room, arrows in re.findall(
        r'^\| `(\w+)` \|.*\|([^|]*)\|$', (ROOT / 'CONTRIBUTING.md').read_text('utf-8'), re.M
    )
}


def modules_in(folder):
    """Return the files of a folder by the names under which they are imported."""
    return {
        '.'.join(path.relative_to(ROOT).with_suffix('').parts).removesuffix('.__init__'): path
        for path in folder.rglob('*.py')
    }


def tree_of(path):
    return ast.parse(path.read_text(encoding='utf-8'))


def imports_of(tree, modules):
    """Return those of the modules that a file imports, wherever in it the import stands.

    Imports for annotations only (``if TYPE_CHECKING``) count too: who reads the file follows them.
    """
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name in modules}
        elif isinstance(node, ast.ImportFrom) and node.module in modules:
            assert node.level == 0, 'imports are absolute'
            inner = {f'{node.module}.{alias.name}' for alias in node.names}
            found |= inner & set(modules)
            # A package that hands a name on is imported itself.
            if inner - set(modules):
                found.add(node.module)
    return found


@functools.cache
def imports(folder):
    """Return what each module of a folder imports of that folder."""
    modules = modules_in(folder)
    return {name: imports_of(tree_of(path), modules) - {name} for name, path in modules.items()}


def room_of(module):
    room = module.partition('.')[2].partition('.')[0]
    return room if room in ARROWS else None


def test_the_rooms_are_these_and_each_says_what_it_is_for():
    folders = {path.parent for path in PACKAGE.rglob('*.py')} - {PACKAGE}
    assert {folder.name for folder in folders} == set(ARROWS)
    assert {path.name for path in PACKAGE.glob('*.py')} == {'__init__.py', 'compiled.py'}
    for folder in folders:
        says = ast.get_docstring(tree_of(folder / '__init__.py'))
        assert says, folder
        assert says.split('\n')[0].endswith('.'), folder


@pytest.mark.parametrize('folder', [PACKAGE, BENCHMARKS], ids=lambda folder: folder.name)
def test_no_file_imports_in_a_circle(folder):
    graph = imports(folder)
    assert len(graph) > 15
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(f'a circle: {" -> ".join(error.args[1])}')


def test_contributing_draws_the_arrows_as_they_are_and_each_points_up_its_table():
    arrows = {room: set() for room in ARROWS}
    for module, others in imports(PACKAGE).items():
        room = room_of(module)
        if room:
            arrows[room] |= {room_of(other) for other in others} - {room, None}
    assert arrows == ARROWS
    above = set()
    for room, others in ARROWS.items():
        assert others <= above, room
        above.add(room)
    # It is no room, and below all rooms but one.
    assert {room_of(module) for module in imports(PACKAGE)['slip_detector.compiled']} == {
        'parameters'
    }
