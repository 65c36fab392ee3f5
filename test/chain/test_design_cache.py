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

"""Designs kept on disk: equal to the bit, never stale, and never in the way."""

import os
import subprocess
import sys

import numpy as np
import pytest

from slip_detector.chain import design_cache
from slip_detector.chain.filters import design
from slip_detector.parameters.detector import ChainConfig
from support.pages import ROOT

KEY = (380.0, (7.0, 50.0), 4)
SECTIONS = np.arange(12.0).reshape(2, 6) / 7.0

DESIGN = """
import sys
from slip_detector.chain.filters import design
from slip_detector.parameters.detector import ChainConfig
print('scipy.signal' in sys.modules, design(ChainConfig(gain=3.0)).tobytes().hex())
print('scipy.signal' in sys.modules)
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """As in a process that has not loaded the signal package, with a cache of its own."""
    monkeypatch.delitem(sys.modules, 'scipy.signal', raising=False)
    folder = tmp_path / 'cache'
    monkeypatch.setattr(design_cache, 'FOLDER', folder)
    return folder


def refuse():
    raise AssertionError('designed though it was kept')


def test_a_second_process_loads_no_signal_package_and_gets_the_same_bits(tmp_path):
    def run():
        done = subprocess.run(
            [sys.executable, '-c', DESIGN],
            cwd=ROOT,
            env={**os.environ, 'XDG_CACHE_HOME': str(tmp_path)},
            capture_output=True,
            text=True,
            check=True,
        )
        before, sections, after = done.stdout.split()
        assert before == 'False'
        return sections, after

    first, loaded = run()
    assert loaded == 'True'
    assert first == design(ChainConfig(gain=3.0)).tobytes().hex()
    assert run() == (first, 'False')


def test_what_was_kept_is_returned_to_the_bit(folder):
    assert np.array_equal(design_cache.load_or_make(KEY, lambda: SECTIONS), SECTIONS)
    assert [path.suffix for path in folder.iterdir()] == ['.npy']
    assert np.array_equal(design_cache.load_or_make(KEY, refuse), SECTIONS)


@pytest.mark.parametrize('change', ['key', 'numpy', 'scipy', 'filters'])
def test_another_key_version_or_way_of_designing_is_designed(folder, monkeypatch, change):
    design_cache.load_or_make(KEY, lambda: SECTIONS)
    key = KEY
    if change == 'key':
        key = (380.0, (7.0, np.nextafter(50.0, 51.0)), 4)
    elif change == 'filters':
        monkeypatch.setattr(design_cache.zlib, 'crc32', len)
    else:
        package = np if change == 'numpy' else design_cache.scipy
        monkeypatch.setattr(package, '__version__', '1.0')
    assert np.array_equal(design_cache.load_or_make(key, lambda: 2 * SECTIONS), 2 * SECTIONS)


@pytest.mark.parametrize('damage', [b'', b'no array', None])
def test_a_damaged_file_is_made_again(folder, damage):
    design_cache.load_or_make(KEY, lambda: SECTIONS)
    path = next(folder.iterdir())
    path.write_bytes(path.read_bytes()[:-1] if damage is None else damage)
    assert np.array_equal(design_cache.load_or_make(KEY, lambda: SECTIONS), SECTIONS)
    assert np.array_equal(design_cache.load_or_make(KEY, refuse), SECTIONS)


def test_an_array_of_another_shape_is_not_taken(folder):
    design_cache.load_or_make(KEY, lambda: SECTIONS)
    np.save(next(folder.iterdir()), np.zeros(3))
    assert np.array_equal(design_cache.load_or_make(KEY, lambda: SECTIONS), SECTIONS)


def test_without_a_place_to_keep_it_the_design_is_returned(folder):
    folder.parent.joinpath('cache').write_text('a file where the folder would be')
    assert np.array_equal(design_cache.load_or_make(KEY, lambda: SECTIONS), SECTIONS)


def test_a_design_that_is_refused_is_not_kept(folder):
    with pytest.raises(AssertionError):
        design_cache.load_or_make(KEY, refuse)
    assert not folder.exists()


def test_with_the_signal_package_loaded_no_file_is_written(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, 'scipy.signal', np)
    assert np.array_equal(design_cache.load_or_make(KEY, lambda: SECTIONS), SECTIONS)
    assert not folder.exists()
