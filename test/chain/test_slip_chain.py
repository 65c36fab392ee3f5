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

"""What the chain takes and gives, what is kept, and the memory of a call."""

import sys
import tracemalloc

import numpy as np
import pytest

from slip_detector.chain.compiled import COMPILED
from slip_detector.chain.kernel import CACHED_VALUES
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.chain.tiles import REUSED_BYTES
from slip_detector.parameters.detector import COMMON_MODES, ChainConfig
from support.chain_cases import bits, noise

# --- input and output ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ('volts', 'shape'),
    [
        (np.zeros((3, 5)), '(3, 5)'),
        (np.zeros((0, 15)), '(0, 15)'),
        (np.zeros(16), '(16,)'),
        (np.zeros((1, 2, 16)), '(1, 2, 16)'),
        ([], '(0,)'),
        ([[1.0, 2.0]], '(1, 2)'),
    ],
)
def test_a_wrong_shape_is_an_error_that_names_both_shapes(volts, shape):
    chain = SlipChain()
    with pytest.raises(ValueError, match='shape') as caught:
        chain.update(volts)
    message = str(caught.value)
    assert shape in message
    assert '(any, 16)' in message
    assert '\n' not in message
    # And nothing happened to the chain.
    rows = noise(28, 40, 16)
    assert bits(chain.update(rows)) == bits(SlipChain().update(rows))


def test_what_was_not_kept_is_an_error_that_says_so():
    volts = noise(29, 60, 16)
    whole = SlipChain().update(volts)
    for kept, lost in (('level', 'envelope'), ('envelope', 'level')):
        result = SlipChain().update(volts, **{lost: False})
        assert np.array_equal(getattr(result, kept), getattr(whole, kept))
        assert np.array_equal(result.flags, whole.flags)
        with pytest.raises(ValueError, match=f'{lost} was not kept.*{lost}=True'):
            getattr(result, lost)
    result = SlipChain().update(volts, level=False, envelope=False)
    assert np.array_equal(result.flags, whole.flags)
    for lost in ('level', 'envelope'):
        with pytest.raises(ValueError, match=f'{lost} was not kept'):
            getattr(result, lost)


def test_what_is_kept_does_not_change_what_follows():
    volts = noise(30, 100, 16)
    chain = SlipChain()
    chain.update(volts[:33], envelope=False, level=False)
    whole = SlipChain().update(volts)
    assert chain.update(volts[33:]).level.tobytes() == whole.level[33:].tobytes()


INPUTS = {
    'float32': lambda volts: volts.astype(np.float32),
    'float16': lambda volts: volts.astype(np.float16),
    'int64': lambda volts: volts.astype(np.int64),
    'uint8': lambda volts: volts.astype(np.uint8),
    'big endian': lambda volts: volts.astype('>f8'),
    'lists': lambda volts: volts.tolist(),
    'rows in a list': list,
    'Fortran order': np.asfortranarray,
    'every other column': lambda volts: np.repeat(volts, 2, axis=1)[:, ::2],
    'backwards in memory': lambda volts: volts[::-1].copy()[::-1],
    'not aligned': lambda volts: np.ndarray(
        volts.shape, np.float64, b'    ' + volts.tobytes(), offset=4
    ),
    'read-only': lambda volts: np.frombuffer(volts.tobytes()).reshape(volts.shape),
}


@pytest.mark.parametrize('made', INPUTS.values(), ids=INPUTS)
def test_any_kind_of_numbers_is_taken(made):
    # Small whole numbers are the same in every type.
    volts = np.random.default_rng(31).integers(0, 100, (70, 16)).astype(np.float64)
    assert bits(SlipChain().update(made(volts))) == bits(SlipChain().update(volts))


def test_flags_hold_all_decisions_side_by_side():
    config = ChainConfig(channels=5, groups={'a': (1, 2), 'b': (3, 4, 5)}, threshold=0.01)
    volts = noise(32, 60, 5)
    volts[20:30, 3] = np.nan
    result = SlipChain(config).update(volts)
    parts = (result.slip[:, None], result.groups, result.can_vote, result.channels, result.valid)
    assert [part.shape[1] for part in parts] == [1, 2, 2, 5, 5]
    assert all(part.dtype == np.bool_ for part in parts)
    assert np.array_equal(result.flags, np.hstack(parts))
    assert np.array_equal(result.channels, result.level > config.threshold)


@pytest.mark.skipif(not COMPILED, reason='interpreted there is one way to write')
@pytest.mark.parametrize('channels', [3, 16, 20, 33])
@pytest.mark.parametrize('votes', [(), ['all']])
def test_results_larger_than_the_caches_are_those_of_small_calls(channels, votes):
    assert_same_in_pieces(CACHED_VALUES // channels + 100, channels, votes)


@pytest.mark.skipif(not COMPILED, reason='interpreted it takes minutes')
def test_results_in_memory_of_their_own_are_those_of_small_calls():
    assert_same_in_pieces(REUSED_BYTES // (8 * 2 * 16) + 100, 16, ())


def assert_same_in_pieces(rows, channels, votes):
    volts = noise(35, rows, channels)
    config = ChainConfig(channels=channels, threshold=0.01)
    whole, chain = SlipChain(config).update(volts, votes=votes), SlipChain(config)
    for piece in np.array_split(np.arange(rows), 9):
        part = chain.update(volts[piece], votes=votes)
        for name in ('flags', 'envelope', 'level', 'vote_statistic'):
            assert np.array_equal(getattr(part, name), getattr(whole, name)[piece]), name
    assert 0 < whole.slip.mean() < 1


# --- memory --------------------------------------------------------------------------------


def overhead_of_one_row(config):
    """Return by how many bytes the peak of a one-row call exceeds the arrays of its result."""
    chain = SlipChain(config)
    rows = noise(33, 5, config.channels)
    for k in range(4):
        chain.update(rows[k : k + 1])
    row = rows[4:]
    tracemalloc.start()
    try:
        chain.update(row)
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        result = chain.update(row)
        peak = tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
    return peak - result.flags.nbytes - result.level.nbytes - result.envelope.nbytes


@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', ['all', 'mean'])
def test_a_row_takes_no_memory_beyond_its_result(common_mode, vote):
    few, many = (
        overhead_of_one_row(ChainConfig(channels=n, common_mode=common_mode, vote=vote))
        for n in (16, 8000)
    )
    # Array headers and the call's own objects, the same for any number of channels; one temporary
    # of a byte per channel would be 8 kB more.
    assert many < few + 2000
    assert few < 6000


@pytest.mark.parametrize('disabled', [(), (3,)])
def test_many_calls_leave_nothing_behind(disabled):
    chain = SlipChain(ChainConfig(disabled_channels=disabled))
    rows = noise(34, 1, 16)
    for _ in range(20):
        chain.update(rows)
    before = sys.getallocatedblocks()
    for _ in range(500):
        chain.update(rows)
    # One object a call would be 500.
    assert sys.getallocatedblocks() - before < 100
