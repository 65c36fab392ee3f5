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

"""What a report has of a recording: bins, intervals, and events."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from report import report_scenes as scenes

from slip_detector.chain.samples import Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.figures import Alarm
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report import overview as module
from slip_detector.report.overview import THRESHOLD_CODE, Overview, events_of, level_codes

CONFIG = ChainConfig(
    channels=3,
    sample_rate_hz=200.0,
    stopbands_hz=(),
    threshold=0.3,
    groups={'a': (1, 2), 'b': (3,)},
)
SAMPLES = 1000


def recorded():
    """Return volts with two bursts that all channels feel, their truth and the chain's result."""
    rng = np.random.default_rng(0)
    truth = np.zeros(SAMPLES, bool)
    truth[250:333] = truth[500:666] = True
    burst = 0.02 * np.sin(2 * np.pi * 20.0 * np.arange(SAMPLES) / CONFIG.sample_rate_hz)
    volts = 4.0 + np.arange(3) + 1e-4 * rng.standard_normal((SAMPLES, 3))
    volts += (truth * burst)[:, None]
    volts[100:130, 1] = np.nan
    volts[7, 2] = np.inf
    return volts, truth, SlipChain(CONFIG).update(volts)


@given(st.lists(st.integers(0, SAMPLES), max_size=8), st.sampled_from([1, 192, 192 * 4, 10**6]))
def test_bins_hold_the_extremes_and_intervals_the_decisions_however_rows_are_cut(cuts, cells):
    volts, truth, result = recorded()
    overview, chain = Overview('a.npz', CONFIG), SlipChain(CONFIG)
    for a, b in itertools.pairwise([0, *sorted(cuts), len(volts)]):
        overview.add(volts[a:b], chain.update(volts[a:b]), truth[a:b])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, 'MOST_CELLS', cells)
        overview.finish(scenes.NOTHING)
    bins = max(cells // 3, 64)
    assert len(overview.low) <= bins < 2 * len(overview.low) or overview.bin_rows == 1
    exact = np.where(np.isfinite(volts), volts, np.nan).astype(np.float32)
    codes = level_codes(result, CONFIG)
    spans = [slice(a, a + overview.bin_rows) for a in range(0, len(volts), overview.bin_rows)]
    np.testing.assert_array_equal(overview.low, [np.fmin.reduce(exact[rows]) for rows in spans])
    np.testing.assert_array_equal(overview.high, [np.fmax.reduce(exact[rows]) for rows in spans])
    np.testing.assert_array_equal(overview.codes, [codes[rows].max(axis=0) for rows in spans])
    drawn = [overview.slip, overview.truth, *overview.groups.values()]
    for intervals, on in zip(drawn, [result.slip, truth, *result.groups.T], strict=True):
        assert intervals.edges == np.flatnonzero(np.diff(on, prepend=0, append=0)).tolist()


def test_a_gap_is_time_without_samples_and_one_of_years_costs_no_memory(monkeypatch):
    volts, truth, result = recorded()
    for seconds, rows in ((2.0, 2400), (1.7e9, 2000 + 340_000_000_000)):
        overview = Overview('a.npz', CONFIG)
        overview.add(volts, result, np.ones(1000, bool))
        overview.gap(seconds)
        overview.add(volts, result, truth)
        monkeypatch.setattr(module, 'MOST_CELLS', 3 * 2400)
        overview.finish(scenes.NOTHING)
        assert overview.rows == rows
        assert len(overview.low) <= 2400
        assert overview.truth.closed()[0] == (0, 1000)
        if seconds == 2.0:
            assert np.isnan(overview.low[1000:1400]).all()
            assert not overview.codes[1000:1400].any()


def test_codes_of_levels_are_above_the_threshold_where_and_only_where_the_channel_is_on():
    _, _, result = recorded()
    codes = level_codes(result, CONFIG)
    assert result.channels.any()
    np.testing.assert_array_equal(codes > THRESHOLD_CODE, result.channels & result.valid)
    np.testing.assert_array_equal(codes == 0, ~result.valid)
    between = (codes > 1) & (codes < 255)
    octaves = np.log2(result.level[between] / CONFIG.threshold)
    drawn = (codes[between].astype(float) - THRESHOLD_CODE) / 16
    assert np.abs(drawn - octaves).max() <= 1 / 16


def test_events_are_the_scored_slips_and_the_false_alarms():
    rows = Samples.evenly(np.zeros((1, 16)), 380.0, np.ones(1, bool))
    settling = Replay(ChainConfig()).run([rows]).slips[0]
    slip = dataclasses.replace(settling, settling=False, lost_at='filter')
    slips = (
        slip,
        dataclasses.replace(slip, alarm=0, latency_s=0.2, late=True, start_s=2.0, lost_at=None),
        dataclasses.replace(slip, alarm=1, latency_s=0.02, start_s=4.0, lost_at=None),
        settling,
    )
    alarms = (
        Alarm(2.2, 2.3, 'true', 1), Alarm(4.5, 4.6, 'repeat', 2), Alarm(1.0, 1.1, 'false', None),
        Alarm(8.0, 8.1, 'settling', None),
    )  # fmt: skip
    outcome = dataclasses.replace(Replay(ChainConfig()).run([]), slips=slips, alarms=alarms)
    assert [(one.outcome, one.start_s, one.latency_s, one.note) for one in events_of(outcome)] == [
        ('missed', 0.0, None, 'lost at: filter'), ('false alarm', 1.0, None, ''),
        ('late', 2.0, 0.2, ''), ('detected', 4.0, 0.02, ''),
    ]  # fmt: skip
