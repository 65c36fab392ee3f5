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

"""What a result offers of its columns."""

import numpy as np
import pytest

from slip_detector.chain.kernel import KEEP_ENVELOPE, KEEP_EXCESS, KEEP_FLOOR, KEEP_LEVEL
from slip_detector.chain.result import SlipResult

N, GROUPS, CHANNELS = 4, 2, 3


def result_of(columns, envelope, level, votes):
    flags = np.arange(N * (1 + 2 * GROUPS + 2 * CHANNELS)).reshape(N, -1) % 3 == 0
    signals = np.arange(float(N * (columns * (envelope + level) + votes))).reshape(N, -1)
    kept = KEEP_ENVELOPE * envelope + KEEP_LEVEL * level
    return SlipResult(flags, signals, (GROUPS, CHANNELS, votes), kept), flags, signals


# The kernel may have more columns than there are channels.
@pytest.mark.parametrize('columns', [CHANNELS, 8])
@pytest.mark.parametrize('votes', [0, 2])
def test_each_signal_is_its_own_columns(columns, votes):
    result, _, signals = result_of(columns, True, True, votes)
    np.testing.assert_array_equal(result.envelope, signals[:, :CHANNELS])
    np.testing.assert_array_equal(result.level, signals[:, columns : columns + CHANNELS])
    np.testing.assert_array_equal(result.vote_statistic, signals[:, 2 * columns :])
    assert result.vote_statistic.shape == (N, votes)


@pytest.mark.parametrize('votes', [0, 2])
def test_a_signal_that_was_not_kept_is_an_error_that_says_how_to_keep_it(votes):
    result, _, signals = result_of(8, False, True, votes)
    np.testing.assert_array_equal(result.level, signals[:, :CHANNELS])
    with pytest.raises(ValueError, match='envelope was not kept: call update with envelope=True'):
        _ = result.envelope
    result, _, signals = result_of(8, False, False, votes)
    np.testing.assert_array_equal(result.vote_statistic, signals)
    with pytest.raises(ValueError, match='level was not kept: call update with level=True'):
        _ = result.level


@pytest.mark.parametrize('columns', [CHANNELS, 8])
@pytest.mark.parametrize('votes', [0, 2])
@pytest.mark.parametrize('before', [0, KEEP_LEVEL, KEEP_ENVELOPE | KEEP_LEVEL])
def test_floor_and_excess_stand_after_envelope_and_level_before_impacts(columns, votes, before):
    kept = before | KEEP_FLOOR | KEEP_EXCESS
    width = columns * kept.bit_count() + 1 + votes
    signals = np.arange(float(N * width)).reshape(N, -1) % 7
    flags = np.zeros((N, 1 + 2 * GROUPS + 2 * CHANNELS), np.bool_)
    result = SlipResult(flags, signals, (GROUPS, CHANNELS, votes), kept)
    floor = columns * before.bit_count()
    np.testing.assert_array_equal(result.floor, signals[:, floor : floor + CHANNELS])
    excess = floor + columns
    np.testing.assert_array_equal(result.excess, signals[:, excess : excess + CHANNELS])
    np.testing.assert_array_equal(result.after_impact, signals[:, excess + columns] != 0)
    np.testing.assert_array_equal(result.vote_statistic, signals[:, excess + columns + 1 :])


def test_decisions_are_side_by_side():
    result, flags, _ = result_of(8, False, False, 0)
    parts = (result.slip[:, None], result.groups, result.can_vote, result.channels, result.valid)
    assert [part.shape[1] for part in parts] == [1, GROUPS, GROUPS, CHANNELS, CHANNELS]
    np.testing.assert_array_equal(np.hstack(parts), flags)
