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

"""What a report shows of a recording, gathered piece by piece."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.figures import Alarm
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.overview import Overview, events_of
from slip_detector.report.signal_codes import level_codes
from support import report_scenes as scenes

CONFIG = scenes.THREE_CHANNELS


def rows_of(n=1000, seed=0):
    """Return volts with two bursts that all channels feel, and their truth."""
    rng = np.random.default_rng(seed)
    truth = np.zeros(n, bool)
    truth[n // 4 : n // 3] = truth[n // 2 : n // 2 + n // 6] = True
    time_s = np.arange(n) / CONFIG.sample_rate_hz
    burst = 0.02 * np.sin(2 * np.pi * 20.0 * time_s)[:, None]
    volts = 4.0 + np.arange(3) + 1e-4 * rng.standard_normal((n, 3)) + truth[:, None] * burst
    return volts, truth


def overview_of(volts, truth, cuts=(), config=CONFIG, **settings):
    overview, chain = Overview('a.npz', config, **settings), SlipChain(config)
    edges = [0, *sorted(cuts), len(volts)]
    for a, b in itertools.pairwise(edges):
        result = chain.update(volts[a:b], envelope=False)
        overview.add(volts[a:b], result, None if truth is None else truth[a:b])
    return overview


def same(one, other):
    assert (one.rows, one.bin_rows) == (other.rows, other.bin_rows)
    for mine, its in zip(one.bins(one.bin_rows), other.bins(one.bin_rows), strict=True):
        np.testing.assert_array_equal(mine, its)
    np.testing.assert_array_equal(one.slip, other.slip)
    np.testing.assert_array_equal(one.truth, other.truth)
    for name, rows in one.groups.items():
        np.testing.assert_array_equal(rows, other.groups[name])
    assert [snippet.start for snippet in one.snippets] == [s.start for s in other.snippets]
    for mine, its in zip(one.snippets, other.snippets, strict=True):
        np.testing.assert_array_equal(mine.volts, its.volts)
        np.testing.assert_array_equal(mine.codes, its.codes)


@given(st.lists(st.integers(0, 1000), max_size=8), st.sampled_from([12, 300, 3 * 2**11]))
def test_any_cut_of_the_rows_gives_the_same_overview(cuts, most_cells):
    volts, truth = rows_of()
    whole = overview_of(volts, truth, most_cells=most_cells)
    same(overview_of(volts, truth, cuts, most_cells=most_cells), whole)


@pytest.mark.parametrize('most_cells', [3 * 2, 3 * 64, 3 * 2048])
def test_bins_hold_the_extremes_of_their_rows(most_cells):
    volts, truth = rows_of()
    volts[100:150, 1] = np.nan
    volts[7, 2] = np.inf
    overview = overview_of(volts, truth, most_cells=most_cells)
    low, high, codes = overview.bins(overview.bin_rows)
    assert len(low) <= most_cells // 3
    assert len(low) == -(-len(volts) // overview.bin_rows)
    exact = np.where(np.isfinite(volts), volts, np.nan).astype(np.float32)
    all_codes = level_codes(SlipChain(CONFIG).update(volts), CONFIG.threshold)
    for b in range(len(low)):
        rows = slice(b * overview.bin_rows, (b + 1) * overview.bin_rows)
        np.testing.assert_array_equal(low[b], np.fmin.reduce(exact[rows]))
        np.testing.assert_array_equal(high[b], np.fmax.reduce(exact[rows]))
        np.testing.assert_array_equal(codes[b], all_codes[rows].max(axis=0))


def test_longer_bins_can_be_asked_for():
    volts, truth = rows_of()
    overview = overview_of(volts, truth)
    assert overview.bin_rows == 1
    low, high, _ = overview.bins(256)
    np.testing.assert_array_equal(low[3], volts[768:].astype(np.float32).min(axis=0))
    np.testing.assert_array_equal(high[1], volts[256:512].astype(np.float32).max(axis=0))


def test_intervals_are_those_of_the_decisions():
    volts, truth = rows_of()
    overview = overview_of(volts, truth, range(0, 1000, 37))
    result = SlipChain(CONFIG).update(volts)
    assert len(overview.slip) >= 2
    for rows, on in [
        (overview.slip, result.slip),
        (overview.truth, truth),
        *zip(overview.groups.values(), result.groups.T, strict=True),
    ]:
        drawn = np.zeros(len(on), bool)
        for start, stop in rows:
            drawn[start:stop] = True
        np.testing.assert_array_equal(drawn, on)


def test_rows_about_the_starts_of_slips_and_alarms_are_kept_as_they_were():
    volts, truth = rows_of(4000)
    overview = overview_of(volts, truth, range(0, 4000, 333), most_cells=3 * 256)
    assert overview.bin_rows == 16
    starts = [*overview.truth[:, 0], *overview.slip[:, 0]]
    for start in starts:
        (found,) = [s for s in overview.snippets if s.start <= start < s.start + len(s.volts)]
        assert found.start <= start - 29
        assert found.start + len(found.volts) >= start + 59
    for snippet in overview.snippets:
        exact = volts[snippet.start : snippet.start + len(snippet.volts)]
        np.testing.assert_array_equal(snippet.volts, exact.astype(np.float32))


def test_memory_does_not_grow_with_the_length():
    volts, truth = rows_of()
    overview, chain = Overview('a.npz', CONFIG, most_cells=3 * 256), SlipChain(CONFIG)
    for _ in range(40):
        overview.add(volts, chain.update(volts), truth)
    assert overview.rows == 40_000
    assert len(overview.bins(overview.bin_rows)[0]) <= 256
    assert sum(len(snippet.volts) for snippet in overview.snippets) <= 4 * 256


def test_a_gap_is_time_without_samples():
    volts, truth = rows_of()
    chain = SlipChain(CONFIG)
    overview = Overview('a.npz', CONFIG)
    overview.add(volts, chain.update(volts), np.ones(1000, bool))
    overview.gap(2.0)
    overview.add(volts, chain.update(volts), truth)
    assert overview.rows == 2400
    assert overview.duration_s == 12.0
    low, _, codes = overview.bins(1)
    assert np.isnan(low[1000:1400]).all()
    assert not codes[1000:1400].any()
    np.testing.assert_array_equal(low[1400:], volts.astype(np.float32))
    np.testing.assert_array_equal(overview.truth, [[0, 1000], [1650, 1733], [1900, 2066]])


def test_a_gap_of_years_costs_no_memory():
    volts, truth = rows_of()
    chain = SlipChain(CONFIG)
    overview = Overview('a.npz', CONFIG, most_cells=3 * 256)
    overview.add(volts, chain.update(volts), truth)
    overview.gap(1.7e9)
    overview.add(volts, chain.update(volts), truth)
    low, high, _ = overview.bins(overview.bin_rows)
    assert len(low) <= 256
    assert np.nanmax(high[-1]) == volts.astype(np.float32).max()


def test_without_labels_there_is_no_truth():
    volts, _ = rows_of()
    overview = overview_of(volts, None)
    assert overview.truth is None
    assert len(overview.snippets) >= 1  # about the alarms


def test_no_rows_are_no_error():
    overview = overview_of(np.empty((0, 3)), np.empty(0, bool))
    assert overview.rows == 0
    assert overview.snippets == []
    assert len(overview.bins(1)[0]) == 0


def test_what_a_report_shows_is_what_became_of_slips_and_alarms():
    volts = np.zeros((1, 16))
    settling = Replay(ChainConfig()).run([Samples.evenly(volts, 380.0, np.ones(1, bool))]).slips[0]
    assert settling.settling
    slip = dataclasses.replace(settling, settling=False, lost_at='filter')
    slips = [
        slip,
        dataclasses.replace(slip, alarm=0, latency_s=0.2, late=True, start_s=2.0, lost_at=None),
        dataclasses.replace(slip, alarm=1, latency_s=0.02, start_s=4.0, lost_at=None),
        dataclasses.replace(settling, start_s=6.0),  # neither found nor missed
    ]
    alarms = [
        Alarm(2.2, 2.3, 'true', 1), Alarm(4.02, 4.3, 'true', 2), Alarm(4.5, 4.6, 'repeat', 2),
        Alarm(1.0, 1.1, 'false', None), Alarm(6.0, 6.1, 'settling', 3),
        Alarm(8.0, 8.1, 'settling', None),
    ]  # fmt: skip
    outcome = dataclasses.replace(
        Replay(ChainConfig()).run([]), slips=tuple(slips), alarms=tuple(alarms)
    )
    shown = events_of(outcome)
    assert [(event.kind, event.start_s, event.latency_s) for event in shown] == [
        ('missed', 0.0, None), ('false alarm', 1.0, None), ('late', 2.0, 0.2),
        ('detected', 4.0, 0.02),
    ]  # fmt: skip
    assert [event.note for event in shown] == ['lost at: filter', '', '', '']
