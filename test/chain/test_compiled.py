"""Compiled functions are kept from run to run, and never run stale."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from slip_detector.chain import compiled

OUTER = """
from kept.compiled import compiled
from kept.inner import value

@compiled
def outer():
    return value() + 1.0

if __name__ == '__main__':
    print(outer(), sum(outer.stats.cache_hits.values()))
"""

INNER = """
from kept.compiled import compiled

@compiled
def value():
    return {}
"""


@pytest.mark.skipif(not compiled.COMPILED, reason='without Numba nothing is kept')
def test_a_change_in_another_file_is_compiled_into_what_calls_it(tmp_path):
    package = tmp_path / 'kept'
    package.mkdir()
    (package / '__init__.py').touch()
    shutil.copy(Path(compiled.__file__), package / 'compiled.py')
    (package / 'outer.py').write_text(OUTER)

    def run(inner):
        (package / 'inner.py').write_text(INNER.format(inner))
        command = [sys.executable, '-m', 'kept.outer']
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
        return done.stdout.split()

    assert run(1.0) == ['2.0', '0']
    assert run(1.0) == ['2.0', '1']  # from the cache
    assert run(41.0) == ['42.0', '0']
