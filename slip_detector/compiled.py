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

"""Functions that Numba compiles where it is installed, and the cache of what it has compiled.

Without Numba the same functions run interpreted. Compiled functions take the values of a
:class:`CompiledSet`.
"""

import contextlib
import fcntl
import functools
import json
import logging
import os
import shutil
import sys
import tempfile
import zlib
from collections import namedtuple
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, ClassVar

import numpy as np

from slip_detector.parameters import CACHE, ParameterSet

LOG = logging.getLogger(__name__)

try:
    import llvmlite.binding
    import numba
    from numba import config, njit, typeof
    from numba.core import event

    COMPILED = True
except ImportError:  # not every robot has Numba
    COMPILED = False
    LOG.warning('Numba is not installed: all runs interpreted, slower, with the same decisions')

#: Beginning of the names of the folders with compiled code, the list of checksums in each, the
#: number of other folders that are kept, and the room in bytes that a new one needs.
FOLDER, LIST, OTHERS_KEPT, ROOM = 'slip_detector-', 'checksums.json', 3, 50_000_000


def _fingerprint() -> str:
    """Return a checksum of versions, processor and all files that have compiled functions."""
    versions = sys.version, np.__version__, numba.__version__, llvmlite.__version__
    number = zlib.crc32(repr((versions, llvmlite.binding.get_host_cpu_name())).encode())
    for path in sorted(Path(__file__).parent.rglob('*.py')):
        source = path.read_bytes()
        if b'@compiled' in source or b'@intrinsic' in source:
            number = zlib.crc32(source, number)
    return f'{number:08x}'


if COMPILED:

    def _lock(folder: Path) -> IO[str]:
        """Return a file that no other process has open in this way until it is closed."""
        file = open(folder.parent / 'slip_detector.lock', 'w')  # noqa: SIM115 - it stays open
        fcntl.flock(file, fcntl.LOCK_EX)
        return file

    def _checksums(folder: Path) -> dict[str, int]:
        """Return the checksums of Numba's files in a folder."""
        files = folder.rglob('*.nb[ci]')
        return {str(p.relative_to(folder)): zlib.crc32(p.read_bytes()) for p in files}

    def _is_whole(folder: Path) -> bool:
        """Return whether a folder has the files of its list; without files there is no list."""
        try:
            return bool(json.loads((folder / LIST).read_bytes()) == _checksums(folder))
        except FileNotFoundError:
            return not _checksums(folder)
        except ValueError:
            return False

    def _open_folder(base: Path) -> Path:
        """Return the folder with code for this package and machine, new if it was damaged.

        Numba checks no file that it loads and no change in a file other than the function's own.
        Therefore the name of the folder is a fingerprint, and a folder that differs from its list
        is dropped.
        """
        base.mkdir(parents=True, exist_ok=True)
        folder = base / f'{FOLDER}{_fingerprint()}'
        with _lock(folder):
            if not _is_whole(folder):
                LOG.warning('compiled code in %s is damaged and is dropped', folder)
                shutil.rmtree(folder)
            if not folder.exists():
                with tempfile.TemporaryFile(dir=base) as file:
                    os.posix_fallocate(file.fileno(), 0, ROOM)
                for other in sorted(base.glob(f'{FOLDER}*'), key=os.path.getmtime)[:-OTHERS_KEPT]:
                    shutil.rmtree(other)
                folder.mkdir()
            os.utime(folder)
        return folder

    class _Listener(event.Listener):  # type: ignore[misc]
        """Says that functions are compiled, and lists the files in which Numba keeps them.

        A lock, from the end of a compilation until Numba has written its result and the list is
        complete, lets several processes use one folder.
        """

        def __init__(self, folder: Path) -> None:
            self._folder, self._said = folder, False
            self._locked: IO[str] | None = None

        def on_start(self, event: Any) -> None:
            """Say once that functions of this package are compiled."""
            if not self._said and event.kind == 'numba:compile':
                self._said = event.data['dispatcher'].__module__.startswith('slip_detector.')
                if self._said:
                    LOG.warning('compiling for up to a minute, only the first time')

        def on_end(self, event: Any) -> None:
            """Lock the folder when a function is compiled, until Numba has written the result."""
            if event.kind == 'numba:compile':
                self._locked = _lock(self._folder)
            elif self._locked:
                # What could not be listed is dropped at the next start.
                with self._locked, contextlib.suppress(OSError):
                    (self._folder / LIST).write_text(json.dumps(_checksums(self._folder)))
                self._locked = None

    def _open_cache() -> bool:
        """Let Numba keep what it compiles; return False where no folder for it can be written."""
        bases = [Path(__file__).parent / '__pycache__', Path(CACHE, 'slip_detector')]
        for base in [Path(config.CACHE_DIR)] if config.CACHE_DIR else bases:
            try:
                folder = _open_folder(base)
            except OSError as error:
                why = f'{base}: {error.strerror}'
                continue
            config.CACHE_DIR, listener = str(folder), _Listener(folder)
            event.register('numba:compile', listener)
            event.register('numba:compiler_lock', listener)
            return True
        LOG.warning('compiled code is not kept (%s): each start compiles', why)
        return False

    IS_KEPT = _open_cache()


def compiled(function: Callable[..., Any], **options: bool) -> Callable[..., Any]:
    """Compile a function with Numba where it is installed, with a cache on disk."""
    if not COMPILED:
        return function
    # error_model: Python's check of each divisor would take a tenth of a scene's time. _nrt:
    # without it Numba compiles a function with the setting of its caller.
    common = {'cache': IS_KEPT, 'error_model': 'numpy', '_nrt': True}
    return njit(**common | options)(function)  # type: ignore[no-any-return]


#: Compiles a function that makes no array and no list, so that a call costs little: Numba counts
#: no references in it. It refuses to compile one that makes an array; to Python it may return
#: numbers, but no arrays.
compiled_in_place = functools.partial(compiled, _nrt=False)

#: Compiles a function in place, whose code becomes part of the functions that call it.
compiled_within = functools.partial(compiled, _nrt=False, forceinline=True)


def compiled_for(function: Callable[..., Any], *arguments: Any) -> Callable[..., Any]:
    """Return a compiled function for calls from Python with arguments of the types of these.

    An ordinary compiled function looks up the types of its arguments at each call. This one does
    not check them: with another type it would read and write memory wrongly.
    """
    if not COMPILED:
        return np.errstate(all='ignore')(function)  # Compiled code overflows silently.
    dispatcher: Any = function
    return dispatcher.compile(tuple(map(typeof, arguments)))  # type: ignore[no-any-return]


class CompiledSet(ParameterSet):
    """A set whose values, but for texts, compiled code takes as a named tuple, as Numba can."""

    Numbers: ClassVar[Any]

    def __init_subclass__(cls) -> None:
        """Make the class of the named tuple."""
        super().__init_subclass__()
        names = [name for name, kind in cls.__annotations__.items() if kind is not str]
        numbers: Any = namedtuple('Numbers', names, module=cls.__module__)  # type: ignore[misc]
        cls.Numbers = numbers
        # By this name Numba finds the tuple of a function that it has compiled in another process.
        cls.Numbers.__qualname__ = f'{cls.__qualname__}.Numbers'

    def numbers(self) -> Any:
        """Return the named tuple of the values, in which lists are arrays."""
        values = (getattr(self, name) for name in self.Numbers._fields)
        return self.Numbers(*(np.array(v) if isinstance(v, tuple) else v for v in values))
