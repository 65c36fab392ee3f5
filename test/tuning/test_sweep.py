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

"""All thresholds and votes from one pass, and which of them are tried."""

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.chain.filters import settling_rows
from slip_detector.compiled import COMPILED
from slip_detector.evaluation.events import Events
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.sweep import VoteStatistics, vote_statistics, votes_of
from slip_detector.tuning.tracks import track_of
from support.track_cases import EVALUATIONS, RATE_HZ, chains, recordings
from support.tuning_cases import track_with


@settings(max_examples=40 if COMPILED else 3, deadline=None)
@given(chains(), st.lists(recordings(), min_size=1, max_size=3), EVALUATIONS, st.randoms())
def test_each_threshold_and_vote_has_the_figures_of_a_chain_with_them_to_the_bit(
    config, several, evaluation, random
):
    kinds = zip(several, ('', 'press', 'rest'), strict=False)
    several = [[piece._replace(kind=kind) for piece in pieces] for pieces, kind in kinds]
    tracks = [track_of('a', pieces, RATE_HZ) for pieces in several]
    scoring = evaluation, settling_rows(config)
    for statistics in vote_statistics(config, votes_of(config), tracks, *scoring):
        limits = statistics.thresholds()
        sweep = Events.pooled(statistics.events(limits))
        for k in {0, limits.size - 1, random.randrange(limits.size)} if limits.size else ():
            chain = dataclasses.replace(statistics.chain, threshold=float(limits[k]))
            replay = Replay(chain, evaluation)
            outcomes = [replay.run(pieces, RATE_HZ) for pieces in several]
            latencies_ms = np.concatenate([one.events.latencies_ms for one in outcomes])
            np.testing.assert_array_equal(sweep.latencies_ms[:, k], latencies_ms[:, 0])
            figures = sweep.at(k) | statistics.count_scores(chain.threshold).aucs()
            assert figures.items() <= figures_of_merit(outcomes).items()


MEAN = ChainConfig()
EVIDENCE = ChainConfig(decision='evidence', noise_floor=1e-3, envelope_window_s=0.02)


def test_the_votes_are_all_counts_of_small_groups_and_shares_of_large_ones():
    small = ChainConfig(channels=5, groups={'a': (1, 2, 3), 'b': (4, 5)})
    large = ChainConfig(groups={'a': tuple(range(1, 17))}, vote='mean')
    assert votes_of(small) == ('all', 'mean', 1)
    assert votes_of(dataclasses.replace(small, vote=2)) == ('all', 'mean', 1, 2)
    assert votes_of(large) == ('all', 'mean', 2, 4, 6, 8, 10, 12, 14)


def thresholds(chain, values):
    """Return the thresholds of a statistic in a recording without slip."""
    quiet = track_with(np.zeros((len(values), 1)))
    return VoteStatistics(chain, [(values, quiet, None)]).thresholds()


@given(values=st.lists(st.floats(1e-6, 1e6), min_size=1, max_size=50), exponent=st.integers(1, 4))
def test_thresholds_rise_in_even_steps_of_amplitude_up_to_where_nothing_is_on(values, exponent):
    statistic = np.array(values)
    chain = ChainConfig(exponent=exponent)
    limits = thresholds(chain, statistic)
    assert limits[-1] >= statistic.max() > 0.999 * limits[-1]
    np.testing.assert_allclose(limits[1:] / limits[:-1], 1.03**exponent, rtol=3e-3)
    lowest = max(np.median(statistic[::16]), statistic.max() * 1000.0**-exponent)
    assert limits[0] <= 1.001 * lowest
    # No more digits than a file is to show.
    assert [float(f'{limit:.4g}') for limit in limits] == limits.tolist()


def test_of_a_statistic_that_no_threshold_divides_there_is_none():
    silent, endless = np.zeros(20), np.array([0.0, np.inf] * 10)
    at_its_limit = np.full(20, EVIDENCE.evidence_limit_db_s)
    for chain, values in ((MEAN, silent), (MEAN, endless), (EVIDENCE, at_its_limit)):
        assert thresholds(chain, values).size == 0


def test_thresholds_of_evidence_are_as_far_apart_as_louder_noise_moves_it_below_its_limit():
    limits = thresholds(EVIDENCE, np.linspace(0.0, 1.3, 20))
    assert 0.95 * 1.3 < limits[-1] < 1.3
    limits = thresholds(EVIDENCE, np.linspace(0.0, 1.0, 20))
    # 3 % of amplitude are 0.257 dB, and a window lasts for 20 ms.
    steps = np.diff(limits[limits < 0.1])
    np.testing.assert_allclose(steps, 0.257 * 0.02, rtol=0.05)
    np.testing.assert_allclose(limits[-10:-1] / limits[-9:], 1 / 1.03, rtol=2e-3)
