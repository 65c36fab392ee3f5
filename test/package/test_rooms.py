"""The rooms of the package, read off its imports."""

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / 'slip_detector'

#: From the ground up: a room imports from those before it, never from those after it.
ROOMS = (
    'parameters',
    'chain',
    'scenes',
    'recordings',
    'sources',
    'evaluation',
    'tuning',
    'grasp',
    'report',
    'commands',
    'nodes',
)
MODULES = {
    '.'.join(path.relative_to(PACKAGE.parent).with_suffix('').parts).removesuffix(
        '.__init__'
    ): path
    for path in PACKAGE.rglob('*.py')
}


def imports_of(tree, modules):
    """Return the modules of the package that a file imports, wherever in it the import stands.

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


def imports():
    return {
        name: imports_of(ast.parse(path.read_text(encoding='utf-8')), MODULES) - {name}
        for name, path in MODULES.items()
    }


def room_of(module):
    return module.split('.')[1] if '.' in module else None


def test_the_rooms_are_these_and_each_says_what_it_is_for():
    folders = {path.parent for path in PACKAGE.rglob('*.py')} - {PACKAGE}
    assert {folder.name for folder in folders} == set(ROOMS)
    assert [path.name for path in PACKAGE.glob('*.py')] == ['__init__.py']
    for folder in folders:
        says = ast.get_docstring(ast.parse((folder / '__init__.py').read_text(encoding='utf-8')))
        assert says, folder
        assert says.split('\n')[0].endswith('.'), folder


def test_no_file_imports_in_a_circle():
    try:
        TopologicalSorter(imports()).prepare()
    except CycleError as error:
        pytest.fail(f'a circle: {" -> ".join(error.args[1])}')


def test_nothing_is_imported_against_the_arrows():
    order = {room: i for i, room in enumerate(ROOMS)}
    against = [
        f'{module} imports {other}'
        for module, others in imports().items()
        for other in others
        if room_of(module) and room_of(other) and order[room_of(other)] > order[room_of(module)]
    ]
    assert not against


def test_a_circle_and_an_import_inside_a_function_are_seen():
    tree = ast.parse('def f():\n    from slip_detector.b import g\n')
    modules = {'slip_detector.a', 'slip_detector.b'}
    assert imports_of(tree, modules) == {'slip_detector.b'}
    both = {'a': {'b'}, 'b': {'a'}}
    with pytest.raises(CycleError):
        TopologicalSorter(both).prepare()
