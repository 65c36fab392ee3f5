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

"""The chain in C++, written by hand for one configuration: a rival of its speed."""

import ctypes
import os
import shlex
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.filters import design
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SOURCE = Path(__file__).with_name('cpp_chain.cpp')

#: Compilers that are tried in this order if ``$CXX`` names none.
COMPILERS = ('g++', 'clang++', 'c++')

OPTIONS = ('-O3', '-march=native')

#: With this in ``NUMBA_CPU_FEATURES`` Numba does not use AVX-512; the name of an older processor
#: does not suffice.
NUMBA_WITHOUT_AVX512 = '+sse4.2,+avx,+avx2,+bmi,+bmi2,+popcnt,+lzcnt,-avx512f'

#: The same for a C++ compiler.
CPP_WITHOUT_AVX512 = '-mno-avx512f'

COMPILE_TIMEOUT_S = 120.0


def find_compiler() -> list[str]:
    """Return the command of a C++ compiler, ``$CXX`` first; empty if there is none."""
    for name in (os.environ.get('CXX', ''), *COMPILERS):
        command = shlex.split(name)
        if command and shutil.which(command[0]):
            return command
    return []


def compiler_options() -> list[str]:
    """Return the options with which the compiler uses the instructions that Numba uses."""
    without = '-avx512f' in os.environ.get('NUMBA_CPU_FEATURES', '')
    return [*OPTIONS, *([CPP_WITHOUT_AVX512] if without else [])]


class CppChain:
    """The chain in C++, in which the compiler knows all lengths; it starts with the first row.

    Parameters
    ----------
    config
        Configuration of the chain; only channels, filters, windows, threshold and groups may
        differ from the defaults.

    Raises
    ------
    ValueError
        When other parameters differ from the defaults.
    RuntimeError
        When there is no compiler, or it fails; says which and why.
    """

    def __init__(self, config: ChainConfig) -> None:
        for name in ('common_mode', 'rectify', 'exponent', 'vote', 'disabled_channels'):
            value, allowed = getattr(config, name), getattr(ChainConfig(), name)
            if value != allowed:
                raise ValueError(f'{name} is {value!r}, allowed in C++: {allowed!r}')
        self._sections = np.ascontiguousarray(design(config))
        groups = list(config.groups.values())
        self._members = np.array([c - 1 for members in groups for c in members], np.int64)
        self._bounds = np.cumsum([0, *map(len, groups)], dtype=np.int64)
        self._width = 1 + 2 * len(groups) + 2 * config.channels
        self._channels = config.channels
        flat_rows = config.samples(config.flat_after_s) if config.flat_after_s else np.inf
        self._numbers = [*config.valid_range_v, flat_rows, config.threshold]
        self._run = _compiled(
            CHANNELS=config.channels,
            SECTIONS=len(self._sections),
            ENVELOPE_ROWS=config.samples(config.envelope_window_s),
            LEVEL_ROWS=config.samples(config.decision_window_s),
            GROUPS=len(groups),
        )

    def update(self, rows: Floats) -> Bools:
        """Take the next rows; return their decisions in the form of ``SlipResult.flags``."""
        volts = np.ascontiguousarray(rows, np.float64)
        if volts.ndim != 2 or volts.shape[1] != self._channels:
            raise ValueError(
                f'rows have the shape {volts.shape}, allowed: (any, {self._channels})'
            )
        flags = np.empty((len(volts), self._width), np.bool_)
        self._run(
            volts.ctypes.data, len(volts), flags.ctypes.data, self._sections.ctypes.data,
            *self._numbers, self._members.ctypes.data, self._bounds.ctypes.data,
        )  # fmt: skip
        return flags


def _compiled(**macros: int) -> 'ctypes._FuncPointer':
    """Compile the chain for these lengths and return its function."""
    compiler = find_compiler()
    if not compiler:
        raise RuntimeError(f'there is no C++ compiler: neither $CXX nor {", ".join(COMPILERS)}')
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / 'cpp_chain.so'
        defined = [f'-D{name}={value}' for name, value in macros.items()]
        failed = f'{shlex.join(compiler)} failed'
        try:
            done = subprocess.run(
                [*compiler, '-std=c++17', *compiler_options(), '-shared', '-fPIC', *defined,
                 str(SOURCE), '-o', str(library)],
                capture_output=True, text=True, timeout=COMPILE_TIMEOUT_S, check=False,
            )  # fmt: skip
            if done.returncode:
                first = (done.stderr.strip() or 'it wrote nothing').splitlines()[0]
                raise RuntimeError(f'{failed}: {first}')
            run = ctypes.CDLL(str(library)).run
        except subprocess.TimeoutExpired:
            raise RuntimeError(f'{failed}: it took longer than {COMPILE_TIMEOUT_S:g} s') from None
        except OSError as error:  # The compiler cannot be started, or its result not be loaded.
            raise RuntimeError(f'{failed}: {error}') from None
    pointer, number = ctypes.c_void_p, ctypes.c_double
    run.argtypes = [
        pointer, ctypes.c_int64, pointer, pointer, number, number, number, number, pointer, pointer
    ]  # fmt: skip
    run.restype = None
    return run
