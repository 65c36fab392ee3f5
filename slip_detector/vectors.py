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

"""Vectors of sixteen values for compiled functions; without Numba, small NumPy arrays.

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

import inspect
import operator

import numpy as np

from slip_detector.compiled import COMPILED, compiled_in_place

#: Values in a vector: twice as many as the widest registers hold, so that the processor computes
#: one half while it waits for the result of the other.
LANES = 16

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

    def _of_one(kind, emit):
        """Return a function of one vector whose result is of a kind."""
        return intrinsic(lambda typing, values: _of_vectors(kind(values), emit))

    def _of_floats(name):
        """Return the LLVM intrinsic of a name for vectors of float64."""

        def emit(builder, a):
            name_of_kind, kind = f'llvm.{name}.v{LANES}f64', ir.FunctionType(a.type, [a.type])
            return builder.call(builder.module.declare_intrinsic(name_of_kind, (), kind), [a])

        return _of_one(FLOATS, emit)

    def _bits_as(kind):
        """Return a function that reads the bits of a vector as another kind."""
        vector = ir.VectorType(kind.bits, LANES)
        return _of_one(kind, lambda builder, a: builder.bitcast(a, vector))

    square_root, absolute, floor = map(_of_floats, ('sqrt', 'fabs', 'floor'))
    words_of, floats_of = map(_bits_as, (WORDS, FLOATS))


@compiled_in_place
def is_number(values):
    """Return which values are not NaN."""
    return values == values  # noqa: PLR0124
