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

"""Vectors: with Numba and without, each operation does what NumPy does with its values."""

import operator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain import lanes
from slip_detector.chain.compiled import COMPILED, compiled
from slip_detector.chain.lanes import (
    LANES,
    LINE,
    absolute,
    float_part,
    floats_of,
    floor,
    in_all,
    integer_part,
    is_number,
    load,
    select,
    spread,
    square_root,
    store,
    store_past_caches,
    word_part,
    words_of,
)
from slip_detector.chain.tiles import aligned

floats = st.lists(st.floats(), min_size=LANES, max_size=LANES).map(np.array)
words = st.lists(st.integers(0, 2**64 - 1), min_size=LANES, max_size=LANES).map(
    lambda values: np.array(values, np.uint64)
)


def of_two(function):
    """Return a compiled function of two arrays that applies one of vectors."""

    @compiled
    def apply(a, b, out):
        store(function(load(a, 0), load(b, 0)), out, 0)

    return apply


def of_one(function):
    @compiled
    def apply(a, out):
        store(function(load(a, 0)), out, 0)

    return apply


ARITHMETIC = {f: of_two(f) for f in (operator.add, operator.sub, operator.mul, operator.truediv)}
COMPARISONS = {
    f: of_two(f) for f in (operator.gt, operator.ge, operator.lt, operator.le, operator.eq)
}
OF_WORDS = {f: of_two(f) for f in (operator.add, operator.and_, operator.or_)}
OF_FLOATS = {square_root: np.sqrt, absolute: np.abs, floor: np.floor}
APPLIED = {f: of_one(f) for f in OF_FLOATS}


def same(found, wanted):
    return np.array_equal(found, wanted, equal_nan=found.dtype == np.float64)


@given(floats, floats)
def test_arithmetic_and_comparisons_are_those_of_ieee_754(a, b):
    with np.errstate(all='ignore'):
        for function, applied in ARITHMETIC.items():
            out = np.empty(LANES)
            applied(a, b, out)
            assert same(out, function(a, b)), function
        for function, applied in COMPARISONS.items():
            out = np.empty(LANES, np.bool_)
            applied(a, b, out)
            assert same(out, function(a, b)), function


@given(words, words)
def test_words_add_and_combine_bit_by_bit(a, b):
    for function, applied in OF_WORDS.items():
        out = np.empty(LANES, np.uint64)
        applied(a, b, out)
        assert same(out, function(a, b)), function


@given(floats)
def test_functions_of_floats_are_those_of_numpy(a):
    with np.errstate(all='ignore'):
        for function, wanted in OF_FLOATS.items():
            out = np.empty(LANES)
            APPLIED[function](a, out)
            assert same(out, wanted(a)), function


@compiled
def _chosen(values, number, out):
    taken = load(values, 0)
    store(select(is_number(taken) & (taken > number), taken * 2.0, number), out, 0)


@given(floats, st.floats(allow_nan=False))
def test_a_number_is_in_all_lanes_and_a_choice_is_made_in_each(values, number):
    out = np.empty(LANES)
    with np.errstate(all='ignore'):
        _chosen(values, number, out)
        assert same(out, np.where(values > number, values * 2.0, number))


@compiled
def _all_above(values, number):
    return in_all(load(values, 0) > number)


@given(floats, st.floats(allow_nan=False))
def test_a_mask_is_set_in_all_lanes_or_not(values, number):
    assert _all_above(values, number) == bool((values > number).all())
    assert _all_above(np.full(LANES, 2.0), 1.0)


@compiled
def _through_bits(values, out):
    shifted = (words_of(load(values, 0)) >> np.uint64(1)) << np.uint64(1)
    store(floats_of(shifted), out, 0)


@given(floats)
def test_floats_become_words_and_back(values):
    out = np.empty(LANES)
    with np.errstate(all='ignore'):
        _through_bits(values, out)
    assert (out.view(np.uint64) == values.view(np.uint64) & np.uint64(2**64 - 2)).all()


@compiled
def _rows(array, out, number):
    store(load(array, (1, 2)), out, (0, 1))
    store(spread(number), out, (1, 1))


def test_vectors_are_read_and_written_from_an_index_on():
    width = LANES + 4
    array, out = np.arange(2.0 * width).reshape(2, width), np.zeros((2, LANES + 2))
    _rows(array, out, 7.0)
    wanted = np.zeros((2, LANES + 2))
    wanted[0, 1:-1], wanted[1, 1:-1] = array[1, 2:-2], 7.0
    np.testing.assert_array_equal(out, wanted)


@compiled
def _copy_past_caches(array, out):
    store_past_caches(load(array, 0), out, (1, LINE))


def test_what_is_written_past_the_caches_is_what_is_read():
    array, out = np.arange(1.0, LANES + 1), aligned(np.zeros, (2, LINE + LANES))
    _copy_past_caches(array, out)
    assert not out[0].any()
    assert out[1].tolist() == [0.0] * LINE + array.tolist()


@compiled
def _parts(array):
    numbers, marks = float_part(array, 1, (2, 3)), word_part(array, 7, (2,))
    places = integer_part(array, 9, (1,))
    numbers[1, 2], marks[1], places[0] = 5.0, np.uint64(2**63), -3
    return numbers[0, 1] + numbers.shape[0] + numbers.size


def test_parts_are_views_with_a_shape_and_a_type():
    array = np.arange(10.0)
    assert _parts(array) == 2.0 + 2 + 6
    assert array[6] == 5.0
    assert array[8:9].view(np.uint64)[0] == 2**63
    assert array[9:].view(np.int64)[0] == -3
    assert array[:6].tolist() == [0, 1, 2, 3, 4, 5]


@pytest.mark.skipif(not COMPILED, reason='interpreted, any types go together')
def test_an_operator_of_vectors_of_different_kinds_is_refused():
    @compiled
    def mixed(values, marks):
        return store(load(values, 0) + load(marks, 0), values, 0)

    with pytest.raises(lanes_error(), match='add'):
        mixed(np.zeros(LANES), np.zeros(LANES, np.uint64))


def lanes_error():
    from numba.core.errors import TypingError

    assert lanes.COMPILED
    return TypingError
