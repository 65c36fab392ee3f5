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

"""Functions that Numba compiles where it is installed, and vectors of sixteen values for them.

Without Numba the same functions run interpreted, and a vector is a small NumPy array. Compiled
functions take the values of a :class:`CompiledSet`.

An inner loop over so few values takes longer to enter than to run, and the compiler does not keep
its values in registers from one row to the next. Therefore compiled functions use vectors
explicitly. There are three kinds: of float64, of uint64 (words) and of bool. Operators take two
vectors of the same kind, or a vector and a number:

- float64: ``+ - * /`` and the comparisons, which are false for NaN;
- words: ``+ & | >> <<`` and ``!=``;
- bool: ``& |``.

Every operation is rounded as IEEE 754 demands, and a multiplication is never fused with an
addition: with and without Numba, and on any processor, the bits are the same.
"""

import contextlib
import fcntl
import functools
import inspect
import json
import logging
import operator
import os
import shutil
import sys
import tempfile
import time
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

#: Values in a vector: twice as many as the widest registers hold, so that the processor computes
#: one half while it waits for the result of the other.
LANES = 16

#: Shortest time, in seconds, between two lines that say that functions are being compiled, and the
#: time without one after which it begins anew.
SAY_S, PAUSE_S = 10.0, 60.0

#: When it was said that functions are being compiled, since that began.
SAID_S: list[float] = []

#: Beginning of the names of the folders with compiled code, the number of other ones that are
#: kept, and the room in bytes that a new one needs.
FOLDER, OTHERS_KEPT, ROOM = 'slip_detector-', 3, 50_000_000


def _say_that_it_compiles(module: str) -> None:
    """Say at once, and then now and then, that functions are compiled: it takes a minute."""
    now_s = time.monotonic()
    if SAID_S and now_s - SAID_S[-1] > PAUSE_S:
        SAID_S.clear()
    if not SAID_S or now_s - SAID_S[-1] >= SAY_S:
        SAID_S.append(now_s)
        LOG.warning('compiling %s, only the first time: %.0f s so far', module, now_s - SAID_S[0])


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

    class _Cache(event.Listener):  # type: ignore[misc]
        """The folder in which Numba keeps compiled code, with a list of the files' checksums.

        Numba checks no file that it loads and no change in a file other than the function's own.
        Therefore the name of the folder is a fingerprint, and a folder that differs from its list
        is dropped. A lock, from the end of a compilation until Numba has written its result and
        the list is complete, lets several processes use one folder.
        """

        def __init__(self, base: Path) -> None:
            self.path = base / f'{FOLDER}{_fingerprint()}'
            self._list, self._lock = self.path / 'checksums.json', base / 'slip_detector.lock'
            self._locked: IO[str] | None = None
            base.mkdir(parents=True, exist_ok=True)
            with self._open_lock():
                if not self._is_whole():
                    LOG.warning('compiled code in %s is damaged and is dropped', self.path)
                    shutil.rmtree(self.path)
                if not self.path.exists():
                    with tempfile.TemporaryFile(dir=base) as file:
                        os.posix_fallocate(file.fileno(), 0, ROOM)
                    others = sorted(base.glob(f'{FOLDER}*'), key=os.path.getmtime)
                    for folder in others[:-OTHERS_KEPT]:
                        shutil.rmtree(folder)
                    self.path.mkdir()
                os.utime(self.path)

        def _open_lock(self) -> IO[str]:
            """Return a file that no other process has open in this way until it is closed."""
            file = open(self._lock, 'w')  # noqa: SIM115 - the caller closes it
            fcntl.flock(file, fcntl.LOCK_EX)
            return file

        def _is_whole(self) -> bool:
            """Return whether the files are those of the list; without files there is no list."""
            try:
                listed = json.loads(self._list.read_bytes())
            except FileNotFoundError:
                listed = {}
            except ValueError:
                return False
            return bool(listed == self._sums())

        def _sums(self) -> dict[str, int]:
            """Return the checksums of Numba's files."""
            files = self.path.rglob('*.nb[ci]')
            return {str(p.relative_to(self.path)): zlib.crc32(p.read_bytes()) for p in files}

        def on_start(self, event: Any) -> None:
            """Say that a function of this package is compiled."""
            if event.kind == 'numba:compile':
                module = event.data['dispatcher'].__module__
                if module.startswith('slip_detector.'):
                    _say_that_it_compiles(module)

        def on_end(self, event: Any) -> None:
            """Lock the folder when a function is compiled, until Numba has written the result."""
            if event.kind == 'numba:compile':
                self._locked = self._open_lock()
            elif self._locked:
                # What could not be listed is dropped at the next start.
                with self._locked, contextlib.suppress(OSError):
                    self._list.write_text(json.dumps(self._sums()))
                self._locked = None

    def _open_cache() -> bool:
        """Let Numba keep what it compiles; return False where no folder for it can be written."""
        bases = [Path(__file__).parent / '__pycache__', Path(CACHE, 'slip_detector')]
        for base in [Path(config.CACHE_DIR)] if config.CACHE_DIR else bases:
            try:
                cache = _Cache(base)
            except OSError as error:
                why = f'{base}: {error.strerror}'
                continue
            config.CACHE_DIR = str(cache.path)
            event.register('numba:compile', cache)
            event.register('numba:compiler_lock', cache)
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


if not COMPILED:
    select, square_root, absolute, floor = np.where, np.sqrt, np.abs, np.floor

    def _lanes_from(at):
        return (*at[:-1], slice(at[-1], at[-1] + LANES))

    def load(array, at):
        """Return the values of an array from the index ``at``, a tuple, on."""
        return array[_lanes_from(at)].copy()

    def store(values, array, at):
        """Write a vector to an array from the index ``at`` on."""
        array[_lanes_from(at)] = values

    def spread(value):
        """Return a number in all lanes."""
        return np.full(LANES, value)

    def words_of(values):
        """Return the bits of float64 as words."""
        return values.view(np.uint64)

    def floats_of(words):
        """Return words, read as the bits of float64."""
        return words.view(np.float64)

else:
    from llvmlite import ir
    from numba.core import cgutils, types
    from numba.extending import intrinsic, models, overload, register_model

    #: Since llvmlite 0.44 (of Numba 0.61) a pointer has no type of what it points to.
    NEEDS_TYPE = 'typ' in inspect.signature(ir.IRBuilder.load).parameters

    class Lanes(types.Type):
        """Numba's type of a vector, with Numba's and LLVM's type of each value."""

        def __init__(self, element, bits):
            self.element, self.bits = element, bits
            super().__init__(f'{LANES} {element}')

    @register_model(Lanes)
    class _LanesModel(models.PrimitiveModel):
        """Represents a vector as one LLVM value."""

        def __init__(self, manager, kind):
            super().__init__(manager, kind, ir.VectorType(kind.bits, LANES))

    BOOLS = Lanes(types.boolean, ir.IntType(1))
    FLOATS = Lanes(types.float64, ir.DoubleType())
    WORDS = Lanes(types.uint64, ir.IntType(64))
    KINDS = {kind.element: kind for kind in (BOOLS, FLOATS, WORDS)}

    def _in_all_lanes(builder, value):
        """Put a number into all lanes; leave a vector as it is."""
        if isinstance(value.type, ir.VectorType):
            return value
        kind, index = ir.VectorType(value.type, LANES), ir.IntType(32)
        first = builder.insert_element(ir.Constant(kind, ir.Undefined), value, index(0))
        zeros = ir.Constant(ir.VectorType(index, LANES), [0] * LANES)
        return builder.shuffle_vector(first, first, zeros)

    def _of_vectors(result, emit):
        """Return the result type and a code generator for ``intrinsic``.

        ``emit`` gets the builder and the arguments, of which numbers are spread to all lanes.
        """

        def codegen(context, builder, signature, args):
            return emit(builder, *(_in_all_lanes(builder, value) for value in args))

        return result, codegen

    def _operator(function, kind, result, name, *before):
        """Define an operator of two vectors, or of a vector and a number, by LLVM's name of it."""

        @intrinsic
        def call(typing, a, b):
            emit = lambda builder, a, b: getattr(builder, name)(*before, a, b)  # noqa: E731
            return _of_vectors(result(a, b), emit)

        @overload(function, jit_options={'forceinline': True})
        def _(a, b):
            if kind in (a, b) and {a, b} <= {kind, kind.element}:
                return lambda a, b: call(a, b)  # noqa: PLW0108 - Numba compiles it
            return None

    for _name in ('add', 'sub', 'mul', 'truediv'):
        _operator(getattr(operator, _name), FLOATS, FLOATS, f'f{_name[-3:]}')
    for _name, _sign in (('gt', '>'), ('ge', '>='), ('lt', '<'), ('le', '<='), ('eq', '==')):
        _operator(getattr(operator, _name), FLOATS, BOOLS, 'fcmp_ordered', _sign)
    for _name, _instruction in (('add', 'add'), ('lshift', 'shl'), ('rshift', 'lshr')):
        _operator(getattr(operator, _name), WORDS, WORDS, _instruction)
    for _kind in (BOOLS, WORDS):
        _operator(operator.and_, _kind, _kind, 'and_')
        _operator(operator.or_, _kind, _kind, 'or_')
    _operator(operator.ne, WORDS, BOOLS, 'icmp_unsigned', '!=')

    def _pointer(context, builder, vector, array_type, at_type, array, at):
        """Return a pointer to the vector at an index of an array."""
        array = context.make_array(array_type)(context, builder, array)
        indices = [
            context.cast(builder, index, kind, types.intp)
            for index, kind in zip(cgutils.unpack_tuple(builder, at), at_type, strict=True)
        ]
        address = cgutils.get_item_pointer(context, builder, array_type, array, indices)
        return builder.bitcast(address, vector.as_pointer())

    @intrinsic
    def load(typing, array, at):
        """Return the values of an array from the index ``at``, a tuple, on."""
        kind = KINDS[array.dtype]
        vector = ir.VectorType(kind.bits, LANES)

        def codegen(context, builder, signature, args):
            pointer = _pointer(context, builder, vector, *signature.args, *args)
            return builder.load(pointer, align=8, **({'typ': vector} if NEEDS_TYPE else {}))

        return kind(array, at), codegen

    @intrinsic
    def store(typing, values, array, at):
        """Write a vector to an array from the index ``at`` on; a bool takes one byte."""

        def codegen(context, builder, signature, args):
            value, align = args[0], 8
            if values == BOOLS:
                value, align = builder.zext(value, ir.VectorType(ir.IntType(8), LANES)), 1
            pointer = _pointer(context, builder, value.type, *signature.args[1:], *args[1:])
            builder.store(value, pointer, align=align)
            return context.get_dummy_value()

        return types.void(values, array, at), codegen

    @intrinsic
    def spread(typing, value):
        """Return a number in all lanes."""
        return _of_vectors(KINDS[value](value), lambda builder, a: a)

    @intrinsic
    def select(typing, mask, a, b):
        """Return ``a`` in the lanes where the mask is set, ``b`` in the others."""
        kind = a if isinstance(a, Lanes) else b if isinstance(b, Lanes) else KINDS[a]
        return _of_vectors(kind(mask, a, b), lambda builder, *args: builder.select(*args))

    def _of_floats(name):
        """Return the LLVM intrinsic of a name for vectors of float64."""

        def emit(builder, a):
            kind = ir.FunctionType(a.type, [a.type])
            name_of_kind = f'llvm.{name}.v{LANES}f64'
            return builder.call(builder.module.declare_intrinsic(name_of_kind, (), kind), [a])

        return intrinsic(lambda typing, values: _of_vectors(FLOATS(values), emit))

    def _bits_as(kind):
        """Return a function that reads the bits of a vector as another kind."""

        def emit(builder, a):
            return builder.bitcast(a, ir.VectorType(kind.bits, LANES))

        return intrinsic(lambda typing, values: _of_vectors(kind(values), emit))

    square_root, absolute, floor = map(_of_floats, ('sqrt', 'fabs', 'floor'))
    words_of, floats_of = map(_bits_as, (WORDS, FLOATS))


@compiled_in_place
def is_number(values):
    """Return which values are not NaN."""
    return values == values  # noqa: PLR0124
