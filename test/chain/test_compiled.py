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

"""Compiled functions are kept from run to run, and never run stale."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from slip_detector.chain import compiled, lanes

PACKAGE = Path(compiled.__file__).parents[1]
COMPILED_FILES = [
    path.relative_to(PACKAGE)
    for path in sorted(PACKAGE.rglob('*.py'))
    if re.search('^@compiled', path.read_text(encoding='utf-8'), re.MULTILINE)
]

OUTER = """
import numpy as np
from slip_detector.chain.compiled import compiled, load_numba_alone
from slip_detector.chain.lanes import LANES, load, store
from slip_detector.chain.inner import value

@compiled
def outer(values):
    store(load(values, 0) + value(), values, 0)

if __name__ == '__main__':
    load_numba_alone()
    values = np.ones(LANES)
    outer(values)
    print(values.mean(), sum(outer.stats.cache_hits.values()))
"""

INNER = """
from slip_detector.chain.compiled import compiled

@compiled
def value():
    return {}
"""


def fingerprint_of(package):
    """Return the fingerprint of a copy of the package."""
    path = package / 'chain' / 'compiled.py'
    spec = importlib.util.spec_from_file_location('copy_of_compiled', path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.FINGERPRINT


@pytest.fixture(scope='module')
def copy(tmp_path_factory):
    package = tmp_path_factory.mktemp('copy') / 'slip_detector'
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns('__pycache__'))
    return package


def test_the_files_of_the_kernel_have_compiled_code():
    of_chain = {path.stem for path in COMPILED_FILES if path.parts[0] == 'chain'}
    assert {'common_mode', 'kernel', 'plan', 'stages', 'stamps', 'votes'} <= of_chain


@pytest.mark.parametrize('changed', [*COMPILED_FILES, Path('chain/lanes.py')], ids=str)
def test_each_file_with_compiled_code_changes_the_name_of_the_cache(changed, copy):
    assert fingerprint_of(copy) == compiled.FINGERPRINT
    source = (copy / changed).read_bytes()
    try:
        (copy / changed).write_bytes(source + b'# changed\n')
        assert fingerprint_of(copy) != compiled.FINGERPRINT
    finally:
        (copy / changed).write_bytes(source)


def test_a_file_without_compiled_code_leaves_the_cache_in_use(copy):
    path = copy / 'chain' / 'filters.py'
    source = path.read_bytes()
    path.write_bytes(source + b'# changed\n')
    assert fingerprint_of(copy) == compiled.FINGERPRINT
    path.write_bytes(source)


@pytest.mark.skipif(not compiled.COMPILED, reason='without Numba nothing is kept')
def test_another_numba_never_finds_what_this_one_has_compiled(copy, monkeypatch):
    assert fingerprint_of(copy) == compiled.FINGERPRINT
    monkeypatch.setattr('numba.__version__', '0.0.1')
    assert fingerprint_of(copy) != compiled.FINGERPRINT


ALONE = """
import sys
import numpy as np
from slip_detector.chain.compiled import load_numba_alone
from slip_detector.chain.stamps import StampGrid

load_numba_alone()
assert StampGrid(0.01, 0.1).arrive_all(np.array([0, 10_000_000]))
assert not {'scipy.linalg', 'coverage'} & sys.modules.keys()

import numba
from scipy.linalg import inv

product = numba.njit(lambda a, b: a @ b)
a = np.array([[1.0, 2.0], [3.0, 5.0]])
np.testing.assert_allclose(product(a, inv(a)), np.eye(2), atol=1e-12)
load_numba_alone()
assert sys.modules['scipy.linalg'] is not None
"""


@pytest.mark.skipif(not compiled.COMPILED, reason='without Numba there is nothing to load')
def test_compiled_functions_run_without_coverage_and_scipy_s_linear_algebra_which_loads_later():
    done = subprocess.run(
        [sys.executable, '-c', ALONE], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(not compiled.COMPILED, reason='without Numba nothing is kept')
def test_a_change_in_another_file_is_compiled_into_what_calls_it(tmp_path):
    chain = tmp_path / 'slip_detector' / 'chain'
    chain.mkdir(parents=True)
    for folder in (chain.parent, chain):
        (folder / '__init__.py').touch()
    for module in (compiled, lanes):
        shutil.copy(module.__file__, chain)
    (chain / 'outer.py').write_text(OUTER)

    def run(inner):
        (chain / 'inner.py').write_text(INNER.format(inner))
        # Python's own cache tells files apart by size and by second: a test is too quick for it.
        command = [sys.executable, '-B', '-m', 'slip_detector.chain.outer']
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
        return done.stdout.split()

    assert run(1.0) == ['2.0', '0']
    assert run(1.0) == ['2.0', '1']  # from the cache
    assert run(2.0) == ['3.0', '0']
    # The vectors' own file is not compiled by itself, but into all that use it.
    path = chain / 'lanes.py'
    path.write_text(path.read_text().replace("(operator.add, 'fadd')", "(operator.add, 'fsub')"))
    assert run(2.0) == ['-1.0', '0']


TOLD = """
from slip_detector.chain.compiled import load_numba_alone, on_compiling
from slip_detector.chain.stamps import StampGrid

load_numba_alone()
on_compiling(print)
grid = StampGrid(1.0, 1.0)
for stamp_ns in (0, 10**9, 2 * 10**9):
    grid.arrive(stamp_ns)
"""


@pytest.mark.skipif(not compiled.COMPILED, reason='without Numba nothing is compiled')
def test_what_is_compiled_is_told_and_what_is_in_the_cache_is_not(tmp_path):
    def told():
        return subprocess.run(
            [sys.executable, '-c', TOLD],
            env={**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path)},
            capture_output=True, text=True, check=True,
        ).stdout.split()  # fmt: skip

    assert told() == ['slip_detector.chain.stamps']
    assert told() == []


COUNTED = """
import numba
import numpy as np
from numba.core.runtime import rtsys
from slip_detector.chain.compiled import load_numba_alone
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.chain.stamps import StampGrid

load_numba_alone()
chain, grid = SlipChain(), StampGrid(0.01, 0.1)
for k in range(3):
    before = rtsys.get_allocation_stats()
    chain.update(np.random.default_rng(k).normal(size=(100, 16)), votes=['all', 'mean', 2])
    grid.arrive(k * 10_000_000)
assert rtsys.get_allocation_stats() == before
numba.njit(lambda values: values.size)(np.zeros(3))
assert rtsys.get_allocation_stats().mi_alloc == before.mi_alloc + 1
"""


@pytest.mark.skipif(not compiled.COMPILED, reason='without Numba nothing is compiled')
def test_nothing_keeps_the_arrays_of_a_call_of_a_function_that_works_in_place():
    done = subprocess.run(
        [sys.executable, '-c', COUNTED],
        env={**os.environ, 'NUMBA_NRT_STATS': '1'},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(not compiled.COMPILED, reason='without Numba nothing is compiled')
def test_a_function_that_makes_an_array_does_not_work_in_place():
    from numba.core.errors import NumbaError

    @compiled.compiled_in_place
    def sum_of_ones(n):
        return np.ones(n).sum()

    with pytest.raises(NumbaError, match='Only accept returning of array passed'):
        sum_of_ones(3)


def test_interpreted_functions_overflow_as_silently_as_compiled_ones(monkeypatch):
    def times_ten(values):
        return values * 10.0

    largest = np.array([1e308])
    monkeypatch.setattr(compiled, 'COMPILED', False)
    with pytest.warns(RuntimeWarning, match='overflow'):
        assert compiled.compiled(times_ten)(largest) == np.inf
    assert compiled.as_silent(compiled.compiled(times_ten))(largest) == np.inf
