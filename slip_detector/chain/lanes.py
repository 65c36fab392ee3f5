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

"""Sixteen values side by side: one value for Numba, a small NumPy array without it.

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

from slip_detector.chain.compiled import COMPILED

#: Values in a vector: twice as many as the widest registers hold, so that the processor computes
#: one half while it waits for the result of the other.
LANES = 16

#: Float64 values in a cache line: loading or storing a vector takes twice as long unless it begins
#: where a line does.
LINE = 8

if not COMPILED:

    def _lanes_from(at):
        *row, i = at if isinstance(at, tuple) else (at,)
        return *row, slice(i, i + LANES)

    def load(array, at):
        """Return the values of an array from the index ``at`` (an integer or a tuple) on."""
        return array[_lanes_from(at)].copy()

    def store(values, array, at):
        """Write a vector to an array from the index ``at`` on."""
        array[_lanes_from(at)] = values

    store_past_caches = store

    def _part_as(dtype):
        def part(array, begin, shape):
            size = int(np.prod(shape))
            return array[begin : begin + size].view(dtype).reshape(shape)

        return part

    float_part, word_part, integer_part = map(_part_as, (np.float64, np.uint64, np.int64))

    def spread(value):
        """Return a number in all lanes."""
        return np.full(LANES, value)

    def select(mask, a, b):
        """Return ``a`` in the lanes where the mask is set, ``b`` in the others."""
        return np.where(mask, a, b)

    def is_number(values):
        """Return which values are not NaN."""
        return ~np.isnan(values)

    def in_all(mask):
        """Return whether the mask is set in all lanes."""
        return bool(mask.all())

    def square_root(values):
        """Return the square roots."""
        return np.sqrt(values)

    def absolute(values):
        """Return the absolute values."""
        return np.abs(values)

    def floor(values):
        """Return the largest integers that are not above the values."""
        return np.floor(values)

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
    from numba.np.arrayobj import populate_array

    #: Since llvmlite 0.44 (of Numba 0.61) a pointer has no type of what it points to.
    NEEDS_TYPE = 'typ' in inspect.signature(ir.IRBuilder.load).parameters

    class Lanes(types.Type):
        """Numba's type of a vector.

        Parameters
        ----------
        element
            Numba's type of each value.
        bits
            LLVM's type of each value.
        """

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
        one = builder.insert_element(ir.Constant(kind, ir.Undefined), value, index(0))
        zeros = ir.Constant(ir.VectorType(index, LANES), [0] * LANES)
        return builder.shuffle_vector(one, one, zeros)

    def _of_vectors(result, emit):
        """Return the result type and a code generator for ``intrinsic``.

        ``emit`` gets the builder and the arguments, of which numbers are spread to all lanes.
        """

        def codegen(context, builder, signature, args):
            return emit(builder, *(_in_all_lanes(builder, value) for value in args))

        return result, codegen

    def _operator(function, kind, result, emit):
        """Define an operator of two vectors, or of a vector and a number, for Numba."""

        @intrinsic
        def call(typing, a, b):
            return _of_vectors(result(a, b), emit)

        @overload(function, jit_options={'forceinline': True})
        def _(a, b):
            if kind not in (a, b) or not {a, b} <= {kind, kind.element}:
                return None

            def of_vectors(a, b):
                return call(a, b)

            return of_vectors

    def _instruction(name, *before):
        return lambda builder, a, b: getattr(builder, name)(*before, a, b)

    for _function, _name in (
        (operator.add, 'fadd'),
        (operator.sub, 'fsub'),
        (operator.mul, 'fmul'),
        (operator.truediv, 'fdiv'),
    ):
        _operator(_function, FLOATS, FLOATS, _instruction(_name))
    for _function, _name in (
        (operator.gt, '>'),
        (operator.ge, '>='),
        (operator.lt, '<'),
        (operator.le, '<='),
        (operator.eq, '=='),
    ):
        _operator(_function, FLOATS, BOOLS, _instruction('fcmp_ordered', _name))
    for _function, _name in (
        (operator.add, 'add'),
        (operator.lshift, 'shl'),
        (operator.rshift, 'lshr'),
    ):
        _operator(_function, WORDS, WORDS, _instruction(_name))
    _operator(operator.ne, WORDS, BOOLS, _instruction('icmp_unsigned', '!='))
    for _kind in (BOOLS, WORDS):
        _operator(operator.and_, _kind, _kind, _instruction('and_'))
        _operator(operator.or_, _kind, _kind, _instruction('or_'))

    def _address(context, builder, array_type, at_type, array, at):
        """Return the address of the value of an array with the index ``at``."""
        made = context.make_array(array_type)(context, builder, array)
        several = isinstance(at_type, types.BaseTuple)
        indices = cgutils.unpack_tuple(builder, at) if several else [at]
        kinds = list(at_type) if several else [at_type]
        indices = [
            context.cast(builder, index, kind, types.intp)
            for index, kind in zip(indices, kinds, strict=True)
        ]
        return cgutils.get_item_pointer(context, builder, array_type, made, indices)

    @intrinsic
    def load(typing, array, at):
        """Return the values of an array from the index ``at`` (an integer or a tuple) on."""
        kind = KINDS[array.dtype]

        def codegen(context, builder, signature, args):
            address = _address(context, builder, *signature.args, *args)
            vector = ir.VectorType(kind.bits, LANES)
            pointer = builder.bitcast(address, vector.as_pointer())
            return builder.load(pointer, align=8, **({'typ': vector} if NEEDS_TYPE else {}))

        return kind(array, at), codegen

    def _write(context, builder, signature, args, align):
        """Write a vector to an array from an index on; return the LLVM instruction."""
        address = _address(context, builder, *signature.args[1:], *args[1:])
        pointer = builder.bitcast(address, args[0].type.as_pointer())
        return builder.store(args[0], pointer, align=align)

    @intrinsic
    def store(typing, values, array, at):
        """Write a vector to an array from the index ``at`` on; a bool takes one byte."""

        def codegen(context, builder, signature, args):
            value, align = args[0], 8
            if values == BOOLS:
                value, align = builder.zext(value, ir.VectorType(ir.IntType(8), LANES)), 1
            _write(context, builder, signature, (value, *args[1:]), align)
            return context.get_dummy_value()

        return types.void(values, array, at), codegen

    @intrinsic
    def store_past_caches(typing, values, array, at):
        """Write a vector of float64 to memory without fetching its cache lines first.

        The index must be where a cache line begins.
        """

        def codegen(context, builder, signature, args):
            written = _write(context, builder, signature, args, 8 * LINE)
            mark = builder.module.add_metadata([ir.IntType(32)(1)])
            written.set_metadata('nontemporal', mark)
            return context.get_dummy_value()

        return types.void(values, array, at), codegen

    def _part_as(element):
        """Return a function that returns a part of an array of 64-bit values as another type.

        Its arguments are the array, the index at which the part begins, and the part's shape. The
        part keeps no reference to the array, so it must not outlive the array.
        """

        @intrinsic
        def part(typing, array, begin, shape):
            kind = types.Array(element, len(shape), 'C')

            def codegen(context, builder, signature, args):
                array_type, begin_type, shape_type = signature.args
                address = _address(context, builder, array_type, begin_type, *args[:2])
                sizes = [
                    context.cast(builder, value, own, types.intp)
                    for value, own in zip(
                        cgutils.unpack_tuple(builder, args[2]), shape_type, strict=True
                    )
                ]
                strides = [ir.Constant(ir.IntType(64), 8)]
                for one in reversed(sizes[1:]):
                    strides.insert(0, builder.mul(strides[0], one))
                made = context.make_array(kind)(context, builder)
                data = builder.bitcast(address, context.get_data_type(element).as_pointer())
                populate_array(made, data, sizes, strides, ir.Constant(ir.IntType(64), 8), None)
                return made._getvalue()

            return kind(array, begin, shape), codegen

        return part

    float_part, word_part, integer_part = map(_part_as, (types.float64, types.uint64, types.int64))

    @intrinsic
    def spread(typing, value):
        """Return a number in all lanes."""
        return _of_vectors(KINDS[value](value), lambda builder, a: a)

    @intrinsic
    def select(typing, mask, a, b):
        """Return ``a`` in the lanes where the mask is set, ``b`` in the others."""
        kind = a if isinstance(a, Lanes) else b if isinstance(b, Lanes) else KINDS[a]
        return _of_vectors(kind(mask, a, b), lambda builder, *args: builder.select(*args))

    @intrinsic
    def is_number(typing, values):
        """Return which values are not NaN."""
        return _of_vectors(BOOLS(values), lambda builder, a: builder.fcmp_ordered('ord', a, a))

    @intrinsic
    def in_all(typing, mask):
        """Return whether the mask is set in all lanes."""

        def codegen(context, builder, signature, args):
            bits = ir.IntType(LANES)
            return builder.icmp_unsigned('==', builder.bitcast(args[0], bits), bits(2**LANES - 1))

        return types.boolean(mask), codegen

    def _of_floats(name):
        """Return a function that emits a call of an LLVM intrinsic by its name, on float64."""

        def emit(builder, a):
            kind = ir.FunctionType(a.type, [a.type])
            function = f'llvm.{name}.v{LANES}f64'
            return builder.call(
                cgutils.get_or_insert_function(builder.module, kind, function), [a]
            )

        return emit

    @intrinsic
    def square_root(typing, values):
        """Return the square roots."""
        return _of_vectors(FLOATS(values), _of_floats('sqrt'))

    @intrinsic
    def absolute(typing, values):
        """Return the absolute values."""
        return _of_vectors(FLOATS(values), _of_floats('fabs'))

    @intrinsic
    def floor(typing, values):
        """Return the largest integers that are not above the values."""
        return _of_vectors(FLOATS(values), _of_floats('floor'))

    def _bits_as(kind):
        return lambda builder, a: builder.bitcast(a, ir.VectorType(kind.bits, LANES))

    @intrinsic
    def words_of(typing, values):
        """Return the bits of float64 as words."""
        return _of_vectors(WORDS(values), _bits_as(WORDS))

    @intrinsic
    def floats_of(typing, words):
        """Return words, read as the bits of float64."""
        return _of_vectors(FLOATS(words), _bits_as(FLOATS))
