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

"""Compiles functions with Numba where it is installed; elsewhere they run interpreted."""

import contextlib
import importlib
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np


@contextlib.contextmanager
def _as_if_missing(module: str) -> Iterator[None]:
    """Within a block, make the import of a module fail, unless it is loaded already."""
    if module in sys.modules:
        yield
        return
    sys.modules[module] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules[module]


try:
    # Numba loads the package coverage if it is installed, which takes a tenth of a node's start.
    # Only a measurement of coverage needs it, and has loaded it already.
    with _as_if_missing('coverage'):
        from numba import __version__ as numba_version
        from numba import njit

    COMPILED = True
except ImportError:  # not every robot has Numba
    numba_version = ''
    COMPILED = False


#: Texts that mark a file with compiled functions.
MARKS = (b'@compiled', b'@intrinsic')


def _fingerprint() -> str:
    """Return a checksum of Numba's version and of all files that have compiled functions.

    Numba writes the index of a cached function before its code. With the version in the name, a
    second process never finds code of another Numba behind a new index, which it cannot read.
    """
    number = zlib.crc32(numba_version.encode())
    for path in sorted(Path(__file__).parents[1].rglob('*.py')):
        source = path.read_bytes()
        if any(mark in source for mark in MARKS):
            number = zlib.crc32(source, number)
    return f'{number:08x}'


FINGERPRINT = _fingerprint()


def load_numba_alone() -> None:
    """Load what Numba needs for a compiled function, but not SciPy's linear algebra.

    For its first compiled function Numba tries to load ``scipy.linalg``, which takes a sixth of a
    node's start and is of no use to the chain. This function makes that fail. Afterwards Numba
    cannot compile ``numpy.cov`` and ``numpy.corrcoef`` in this process; SciPy itself can still be
    loaded.

    Examples
    --------
    >>> load_numba_alone()
    """
    if COMPILED:
        with _as_if_missing('scipy.linalg'):
            importlib.import_module('numba.np.arraymath')


def on_compiling(say: Callable[[str], None]) -> None:
    """Call a function each time that Numba compiles a function of this package.

    Parameters
    ----------
    say
        Called before the compilation, in the same thread, with the name of the function's module.

    Examples
    --------
    >>> modules = []
    >>> on_compiling(modules.append)
    """
    if not COMPILED:
        return
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, happened: Any) -> None:
            module = happened.data['dispatcher'].py_func.__module__
            if module.startswith('slip_detector.'):  # Numba's own functions are compiled too.
                say(module)

        def on_end(self, happened: Any) -> None:
            pass

    event.register('numba:compile', Listener())


def as_silent(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that overflows silently when interpreted, as compiled code does."""
    return function if COMPILED else np.errstate(all='ignore')(function)


def compiled(function: Callable[..., Any], **options: bool) -> Callable[..., Any]:
    """Compile a function with Numba where it is installed, with a cache on disk.

    The options are Numba's: with ``forceinline=True`` the function's code always becomes part of
    the functions that call it.

    Numba uses a cached function as long as its own file is unchanged, even where functions of
    other files that are compiled into it have changed. Therefore the name in the cache depends on
    all files with compiled functions and on Numba's version, and no cached function is stale.
    """
    if not COMPILED:
        return function
    function.__qualname__ += f'_{FINGERPRINT}'
    # error_model: Python's check of each divisor would take a tenth of a scene's time. _nrt:
    # without it Numba compiles a function with the setting of its caller.
    common = {'cache': True, 'error_model': 'numpy', '_nrt': True}
    kept: Callable[..., Any] = njit(**common | options)(function)
    return kept


def compiled_in_place(function: Callable[..., Any], **options: bool) -> Callable[..., Any]:
    """Compile a function that makes no array and no list, so that a call costs little.

    Numba counts no references in such a function. In others it wraps each array of a call from
    Python in an object that keeps the array alive, and counts references to all array arguments,
    those within tuples too.

    Numba refuses to compile such a function if it makes an array. To Python it may return numbers,
    but no arrays.
    """
    return compiled(function, _nrt=False, **options)


def compiled_for(signature: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a compiled function for calls from Python with arguments of exactly these types.

    An ordinary compiled function looks up the types of its arguments at each call. This one does
    not check them: with another type it would read and write memory wrongly.

    Parameters
    ----------
    signature
        The types as Numba writes them, such as ``(float64[:, ::1], int64)``.
    function
        A result of :func:`compiled` or :func:`compiled_in_place`; compiled or loaded at once.
    """
    if not COMPILED:
        return function
    kept: Callable[..., Any] = function.compile(signature)  # type: ignore[attr-defined]
    return kept
