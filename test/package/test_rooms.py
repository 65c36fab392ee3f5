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
from package.imported_names import imported_names

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


@functools.cache
def imports(folder):
    """Return what each module of a folder imports of that folder."""
    modules = modules_in(folder)
    found = {}
    for module, path in modules.items():
        names = imported_names(path)
        # A module that hands a name on is imported itself.
        names = {name if name in modules else name.rpartition('.')[0] for name in names}
        found[module] = (names & {*modules}) - {module}
    return found


def room_of(module):
    room = module.partition('.')[2].partition('.')[0]
    return room if room in ARROWS else None


def test_the_rooms_are_these_and_each_says_what_it_is_for():
    folders = {path.parent for path in PACKAGE.rglob('*.py')} - {PACKAGE}
    assert {folder.name for folder in folders} == set(ARROWS)
    files = {path.name for path in PACKAGE.glob('*.py')}
    assert files == {'__init__.py', 'compiled.py', 'vectors.py'}
    for folder in folders:
        says = ast.get_docstring(ast.parse((folder / '__init__.py').read_text('utf-8')))
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


def test_no_room_has_more_than_six_floors_of_files():
    graph = imports(PACKAGE)

    @functools.cache
    def floor(module):
        inside = [other for other in graph[module] if room_of(other) == room_of(module)]
        return 1 + max(map(floor, inside), default=0)

    files = [module for module in graph if module.count('.') == 2]
    assert {module for module in files if floor(module) > 6} == set()


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
