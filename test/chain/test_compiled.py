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

"""Compiled functions are kept from run to run and never run stale; vectors are those of NumPy."""

import importlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slip_detector import compiled
from slip_detector.compiled import (
    LANES,
    absolute,
    floor,
    is_number,
    load,
    select,
    spread,
    square_root,
    store,
)
from support.limits import full_disk

PACKAGE = Path(compiled.__file__).parent

needs_numba = pytest.mark.skipif(not compiled.COMPILED, reason='without Numba nothing is compiled')


# --- the cache -----------------------------------------------------------------------------


OUTER = """
import numpy as np
from slip_detector.compiled import LANES, compiled, load, store
from slip_detector.inner import value

@compiled
def outer(values):
    store(load(values, (0,)) + value(), values, (0,))

if __name__ == '__main__':
    values = np.ones(LANES)
    outer(values)
    print(values.mean(), sum(outer.stats.cache_hits.values()))
"""

INNER = """
from slip_detector.compiled import compiled

@compiled
def value():
    return {}
"""


@needs_numba
def test_a_change_in_another_file_is_compiled_into_what_calls_it(tmp_path):
    package = tmp_path / 'slip_detector'
    shutil.copytree(PACKAGE / 'parameters', package / 'parameters')
    (package / '__init__.py').touch()
    path = Path(shutil.copy(compiled.__file__, package))
    (package / 'outer.py').write_text(OUTER)

    def run(inner):
        (package / 'inner.py').write_text(INNER.format(inner))
        # Python's own cache tells files apart by size and by second: a test is too quick for it.
        command = [sys.executable, '-B', '-m', 'slip_detector.outer']
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
        return done.stdout.split()

    assert run(1.0) == ['2.0', '0']
    assert run(1.0) == ['2.0', '1']  # from the cache
    assert run(2.0) == ['3.0', '0']
    # The vectors are not compiled by themselves, but into all that use them.
    path.write_text(path.read_text().replace("f'f{_name[-3:]}'", "'fsub'"))
    assert run(2.0) == ['-1.0', '0']


ONE = """
from slip_detector.compiled import compiled

@compiled
def one():
    return 1
"""


@pytest.fixture
def cached_calls(tmp_path, monkeypatch):
    """Return a function that imports a module anew, calls it, and tells if it was in the cache."""
    (tmp_path / 'one_of_a_test.py').write_text(ONE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delenv('NUMBA_CACHE_DIR', raising=False)

    def call():
        sys.modules.pop('one_of_a_test', None)
        one = importlib.import_module('one_of_a_test').one
        assert one() == 1
        return bool(one.stats.cache_hits)

    yield call
    sys.modules.pop('one_of_a_test', None)


@needs_numba
@pytest.mark.parametrize('damaged', [
    lambda data: b'', lambda data: data[: len(data) // 2], lambda data: bytes(len(data)),
    lambda data: data[:-99] + bytes([data[-99] ^ 1]) + data[-98:],
], ids=['empty', 'cut', 'zeroed', 'flipped'])  # fmt: skip
def test_what_is_damaged_in_the_cache_is_compiled_again(cached_calls, tmp_path, damaged):
    assert [cached_calls(), cached_calls()] == [False, True]
    (path,) = (tmp_path / '__pycache__').glob('*.nbc')
    path.write_bytes(damaged(path.read_bytes()))
    assert [cached_calls(), cached_calls()] == [False, True]


@needs_numba
def test_without_a_cache_that_can_be_written_it_is_compiled_in_memory_and_said_once(
    cached_calls, monkeypatch, caplog
):
    from numba.core.caching import CacheImpl

    with full_disk(100):
        assert [cached_calls(), cached_calls()] == [False, False]
    monkeypatch.setattr(CacheImpl, '_locator_classes', [])
    assert [cached_calls(), cached_calls()] == [False, False]
    said = [line for line in caplog.messages if not line.startswith('compiling')]
    assert [re.sub(r'/.*/', '...', line) for line in said] == [
        'compiled code is not kept (...__pycache__ cannot be written): each start compiles',
        'compiled code is not kept (no folder for it can be written): each start compiles',
    ]


def test_it_says_at_once_and_then_every_ten_seconds_that_it_compiles(monkeypatch, caplog):
    monkeypatch.setattr(compiled, 'SAID_S', [])
    for now_s in (100.0, 109.9, 112.0, 121.0, 122.0, 200.0):
        monkeypatch.setattr(compiled.time, 'monotonic', lambda: now_s)  # noqa: B023
        compiled._say_that_it_compiles('m')
    said = ['0 s so far', '12 s so far', '22 s so far', '0 s so far']
    assert caplog.messages == [f'compiling m, only the first time: {words}' for words in said]


ALL_COMPILED = """
import numpy as np
from slip_detector.chain.slip_chain import SlipChain, compile_chain
from slip_detector.chain.stamps import StampGrid
from slip_detector.parameters.detector import ChainConfig
from support.compiled_signatures import compiled_signatures

compile_chain()
before = compiled_signatures()
assert before
for changes in ({}, {'channels': 3, 'vote': 'mean', 'common_mode': 'median'}, {'channels': 40}):
    config = ChainConfig(**changes)
    SlipChain(config).update(np.zeros((100, config.channels)), votes=['all', 2])
grid = StampGrid(period_s=0.01, max_gap_s=0.1)
grid.mend(np.array([0, 10, 40, 1000, 900]) * 1_000_000)
grid.arrive(1_100_000_000, 10)
assert compiled_signatures() == before
"""


@needs_numba
def test_nothing_is_left_to_be_compiled_when_samples_come():
    done = subprocess.run(
        [sys.executable, '-c', ALL_COMPILED],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
        capture_output=True, text=True, check=False, timeout=240,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


# --- vectors -------------------------------------------------------------------------------


FLOATS = arrays(np.float64, LANES, elements=st.floats(allow_subnormal=True))


@compiled.compiled
def run_on_floats(a, b, out):
    x, y = load(a, (0,)), load(b, (0,))
    results = (x + y, x - y, x * y, x / y, y - 2.0, square_root(x), absolute(x), floor(x))
    for k in range(8):
        store(results[k], out, (k, 0))
    masks = (x > y, x >= y, x < y, x <= y, x == y, is_number(x))
    for k in range(6):
        store(select(masks[k], x, spread(-1.0)), out, (8 + k, 0))
    store(select((x > y) | (x < 0.0) & is_number(y), 1.0, x), out, (14, 0))


@given(FLOATS, FLOATS)
def test_vectors_of_floats_are_computed_as_ieee_754_demands(a, b):
    out = np.empty((15, LANES))
    with np.errstate(all='ignore'):
        run_on_floats(a, b, out)
        wanted = [a + b, a - b, a * b, a / b, b - 2.0, np.sqrt(a), np.abs(a), np.floor(a)]
        masks = [a > b, a >= b, a < b, a <= b, a == b, ~np.isnan(a)]
        wanted += [np.where(mask, a, -1.0) for mask in masks]
        wanted.append(np.where((a > b) | (a < 0) & ~np.isnan(b), 1.0, a))
    np.testing.assert_array_equal(out, wanted)
