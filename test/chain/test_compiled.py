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

import fcntl
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slip_detector import compiled
from slip_detector.vectors import (
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
from support.python_runs import run_python

PACKAGE = Path(compiled.__file__).parent

needs_numba = pytest.mark.skipif(not compiled.COMPILED, reason='without Numba nothing is compiled')


# --- the cache -----------------------------------------------------------------------------


OUTER = """
import sys
import numpy as np
from slip_detector.compiled import compiled
from slip_detector.vectors import LANES, load, store
from slip_detector.inner import value

@compiled
def outer(values):
    store(load(values, (0,)) + value(), values, (0,))

@compiled
def total(values):
    return values.sum()

values = np.ones(LANES)
outer(values)
for kind in sys.argv[1:]:
    assert total(np.ones(5, kind)) == 5
print(values.mean(), sum(sum(f.stats.cache_hits.values()) for f in (outer, total)))
"""

INNER = """
from slip_detector.compiled import compiled

@compiled
def value():
    return {}
"""


class CopiedPackage:
    """A package with two compiled functions, beside copies of what compiles them."""

    def __init__(self, folder):
        self.folder, package = folder, folder / 'slip_detector'
        shutil.copytree(PACKAGE / 'parameters', package / 'parameters')
        (package / '__init__.py').touch()
        self.vectors, self.inner = package / 'vectors.py', package / 'inner.py'
        shutil.copy(compiled.__file__, package)
        shutil.copy(PACKAGE / 'vectors.py', package)
        (package / 'outer.py').write_text(OUTER)
        self.inner.write_text(INNER.format(1.0))
        self.cache = package / '__pycache__'

    def start(self, *words):
        """Start a process that prints a mean, and how many functions were in the cache."""
        environment = {**os.environ, 'NUMBA_CACHE_DIR': '', 'XDG_CACHE_HOME': '/dev/null/none'}
        # Python's own cache tells files apart by size and by second: a test is too quick for it.
        return subprocess.Popen(
            [sys.executable, '-B', '-m', 'slip_detector.outer', *words], cwd=self.folder,
            env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def run(self, *words):
        """Return what a process prints, and in which lines it says more than that it compiles."""
        printed, said = self.start(*words).communicate()
        lines = [line for line in said.splitlines() if not line.startswith('compiling ')]
        return [*printed.split(), *lines]


@pytest.fixture
def package(tmp_path):
    if not compiled.COMPILED:
        pytest.skip('without Numba nothing is compiled')
    return CopiedPackage(tmp_path)


def test_a_change_in_another_file_is_compiled_into_what_calls_it(package):
    said = 'compiling slip_detector.inner; all takes up to a minute, the first time\n'
    assert package.start().communicate() == ('2.0 0\n', said)
    assert package.start().communicate() == ('2.0 1\n', '')  # from the cache
    package.inner.write_text(INNER.format(2.0))
    assert package.run() == ['3.0', '0']
    # The vectors are not compiled by themselves, but into all that use them.
    source = package.vectors.read_text()
    package.vectors.write_text(source.replace("f'f{_name[-3:]}'", "'fsub'"))
    assert package.run() == ['-1.0', '0']


@needs_numba
def test_it_says_at_once_and_then_every_ten_seconds_that_it_compiles(
    monkeypatch, caplog, tmp_path
):
    listener = compiled._Listener(tmp_path)
    event = SimpleNamespace(kind='numba:compile', data={'dispatcher': compiled.compiled})
    said = []
    for now_s in (100.0, 109.9, 112.0, 121.0, 122.0, 200.0):
        monkeypatch.setattr(compiled.time, 'monotonic', lambda: now_s)  # noqa: B023
        listener.on_start(event)
        said.append(len(caplog.messages))
    assert said == [1, 1, 2, 2, 3, 4]


def test_of_folders_with_compiled_code_those_used_last_are_kept(package):
    for number in range(6):
        other = package.cache / f'slip_detector-{number}'
        other.mkdir(parents=True)
        os.utime(other, (number, number))
    compiled._open_folder(package.cache)
    kept = {path.name for path in package.cache.glob('slip_detector-*/')}
    assert kept > {f'slip_detector-{number}' for number in (3, 4, 5)}
    assert len(kept) == 4


def flipped(data):
    return data[:-99] + bytes([data[-99] ^ 1]) + data[-98:]


def test_a_damaged_file_is_dropped_with_its_folder_and_that_is_said(package, monkeypatch, caplog):
    package.run()
    (folder,) = package.cache.glob('slip_detector-*/')
    said = f'compiled code in {folder} is damaged and is dropped'
    whole, name = shutil.copytree(folder, package.folder / 'whole'), folder.name
    monkeypatch.setattr(compiled, '_fingerprint', lambda: name.removeprefix(compiled.FOLDER))
    for file, damaged in (
        ('*/*.nbc', flipped),
        ('*/*.nbi', flipped),
        ('*/*.nbc', lambda data: data[: len(data) // 2]),
        ('checksums.json', lambda data: bytes(len(data))),
    ):
        path = next(folder.glob(file))
        path.write_bytes(damaged(path.read_bytes()))
        assert list(compiled._open_folder(package.cache).iterdir()) == []
        shutil.copytree(whole, folder, dirs_exist_ok=True)
    assert caplog.messages == [said] * 4
    path.write_bytes(b'')
    assert [package.run(), package.run()] == [['2.0', '0', said], ['2.0', '1']]


def test_processes_that_start_at_once_on_an_empty_cache_all_leave_what_they_compiled(package):
    kinds = ('f4', 'f8', 'i8')
    package.cache.mkdir()
    with open(package.cache / 'slip_detector.lock', 'w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # All begin when this is closed.
        started = [package.start(kind) for kind in kinds]
    assert [process.communicate()[0].split()[0] for process in started] == ['2.0'] * len(kinds)
    assert package.run(*kinds) == ['2.0', str(1 + len(kinds))]


def test_without_a_cache_that_can_be_written_it_is_compiled_in_memory_and_said(package):
    why = 'compiled code is not kept (/dev/null/none/slip_detector: Not a directory)'
    with full_disk(100):
        assert package.run() == ['2.0', '0', f'{why}: each start compiles']
    shutil.rmtree(package.cache)
    package.cache.touch()
    assert package.run() == ['2.0', '0', f'{why}: each start compiles']


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
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}
    done = run_python('-c', ALL_COMPILED, env=environment, timeout=240.0)
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
