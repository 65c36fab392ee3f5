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

"""The chain in C++: it decides as the chain does, where there is a compiler."""

import sys

import numpy as np
import pytest

from benchmarks.chain import cpp_chain
from benchmarks.chain.cpp_chain import (
    CPP_WITHOUT_AVX512,
    NUMBA_WITHOUT_AVX512,
    CppChain,
    compiler_options,
    find_compiler,
)
from benchmarks.noise import swelling_noise_v
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig

needs_compiler = pytest.mark.skipif(not find_compiler(), reason='there is no C++ compiler')


@needs_compiler
def test_it_decides_as_the_chain_does_however_the_rows_are_cut():
    config = ChainConfig(
        channels=5, groups={'a': (1, 2, 3), 'b': (4, 5)}, valid_range_v=(0.0, 8.0),
        flat_after_s=0.2, decision_window_s=0.03, stopbands_hz=((50.0, 180.0),),
    )  # fmt: skip
    volts = swelling_noise_v(1500, config.channels)
    volts[:10, 1] = np.nan
    volts[700:720, 2] = 9.0
    volts[900:1100, 3] = volts[900, 3]
    wanted, rival = SlipChain(config).update(volts), CppChain(config)
    found = np.concatenate([rival.update(piece) for piece in np.split(volts, [1, 2, 300, 1000])])
    np.testing.assert_array_equal(found, wanted.flags)
    assert 0.05 < wanted.slip.mean() < 0.95
    assert not wanted.valid.all()


@pytest.mark.parametrize(
    ('script', 'why'),
    [
        ('import sys; sys.exit("no\\nmemory")', r'no$'),
        ('import time; time.sleep(60)', r'it took longer than 0\.5 s$'),
        ('', r'cpp_chain\.so: cannot open'),
        (None, r'Exec format error'),
    ],
)
def test_a_compiler_that_fails_or_hangs_is_one_line(tmp_path, monkeypatch, script, why):
    compiler = tmp_path / 'compiler'
    compiler.write_text('\x7fELF' if script is None else f'#!{sys.executable}\n{script}')
    compiler.chmod(0o755)
    monkeypatch.setenv('CXX', str(compiler))
    monkeypatch.setattr(cpp_chain, 'COMPILE_TIMEOUT_S', 0.5 if 'sleep' in str(script) else 60.0)
    with pytest.raises(RuntimeError, match=f'compiler failed: .*{why}') as raised:
        CppChain(ChainConfig())
    assert len(str(raised.value).splitlines()) == 1


@needs_compiler
def test_rows_of_another_width_are_refused():
    with pytest.raises(ValueError, match=r'shape \(3, 5\), allowed: \(any, 16\)'):
        CppChain(ChainConfig()).update(np.zeros((3, 5)))


@pytest.mark.parametrize(
    'values', [{'vote': 'mean'}, {'common_mode': 'median'}, {'exponent': 2}, {'rectify': 'half'}]
)
def test_what_it_cannot_do_is_refused(values):
    with pytest.raises(ValueError, match=f'{next(iter(values))} is .*allowed in C'):
        CppChain(ChainConfig(**values))


def test_the_compiler_that_is_named_comes_first(monkeypatch):
    monkeypatch.setattr(cpp_chain.shutil, 'which', lambda name: f'/somewhere/{name}')
    monkeypatch.setenv('CXX', 'mine --fast')
    assert find_compiler() == ['mine', '--fast']
    monkeypatch.delenv('CXX')
    assert find_compiler() == [cpp_chain.COMPILERS[0]]


def test_without_a_compiler_it_says_so(monkeypatch):
    monkeypatch.setattr(cpp_chain.shutil, 'which', lambda name: None)
    with pytest.raises(RuntimeError, match=r'no C\+\+ compiler: neither \$CXX nor g\+\+'):
        CppChain(ChainConfig())


def test_both_sides_have_the_same_vectors(monkeypatch):
    monkeypatch.setenv('NUMBA_CPU_FEATURES', NUMBA_WITHOUT_AVX512)
    assert CPP_WITHOUT_AVX512 in compiler_options()
    monkeypatch.delenv('NUMBA_CPU_FEATURES')
    assert CPP_WITHOUT_AVX512 not in compiler_options()
