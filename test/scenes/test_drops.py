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

"""Lost samples: their share, their bursts, the same in any cut."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.scenes.faults import Drops, LossyLink
from support.disturbance_cases import CUTS, RefusingGenerator, check_refused, trial


@given(CUTS, st.integers(0, 99))
def test_any_cut_of_a_lossy_link_loses_the_same_samples(cuts, seed):
    drops = Drops(share=0.3, burst_samples=2.5)
    whole = LossyLink(drops, trial(seed)).kept(600)
    link, edges = LossyLink(drops, trial(seed)), np.concatenate([[0], cuts])
    pieces = [link.kept(n) for n in np.diff(edges)]
    pieces.append(link.kept(600)[: max(0, 600 - edges[-1])])
    np.testing.assert_array_equal(np.concatenate(pieces)[:600], whole)


@settings(max_examples=15)
@given(st.floats(0.01, 0.7), st.floats(1, 20), st.integers(0, 99))
def test_the_share_and_the_bursts_of_lost_samples_are_those_asked_for(share, burst, seed):
    share = min(share, 0.95 * burst / (burst + 1))
    lost = ~LossyLink(Drops(share=share, burst_samples=burst), trial(seed)).kept(100_000)
    begins = np.count_nonzero(np.diff(lost.astype(int), prepend=0) == 1)
    # Bursts and the gaps between them are geometric: their numbers tell the spread of the means.
    tolerance = 6 / np.sqrt(begins)
    assert np.mean(lost) == pytest.approx(share, rel=tolerance)
    assert np.count_nonzero(lost) / begins == pytest.approx(burst, rel=tolerance)


def test_a_burst_of_one_never_loses_two_in_a_row():
    lost = ~LossyLink(Drops(share=0.4), trial()).kept(10_000)
    assert lost.any()
    assert not np.any(lost[1:] & lost[:-1])


def test_without_losses_nothing_is_drawn():
    assert LossyLink(Drops(share=0.0), RefusingGenerator()).kept(100).all()
    with pytest.raises(AssertionError, match='something was drawn'):
        LossyLink(Drops(), RefusingGenerator()).kept(1)


@pytest.mark.parametrize(
    ('parameters', 'said'),
    [
        (
            {'share': 0.6},
            'parameter share is 0.6, allowed: at most 0.5 with a burst_samples of 1',
        ),
        ({'burst_samples': 0}, 'parameter burst_samples is 0, allowed: 1 to 1e+06'),
    ],
)
def test_a_wrong_parameter_is_named_with_what_is_allowed(parameters, said):
    check_refused(Drops, parameters, said)


def test_parameters_survive_being_written_and_read():
    part = Drops()
    assert type(part).from_parameters(part.to_parameters()) == part
