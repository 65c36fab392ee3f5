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

"""What a report's timeline is drawn from, as bytes."""

import base64
import zlib

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.report import page_data as report_data
from slip_detector.report.page_data import SearchTrial, trade_off_front
from support import report_scenes as scenes


def unplaned(data, n, size):
    """Return n numbers of which all lowest bytes come first; and what is left of the data."""
    planes = np.frombuffer(data[: n * size], np.uint8).reshape(size, n).astype(np.uint64)
    factors = 256 ** np.arange(size, dtype=np.uint64)
    return (planes * factors[:, None]).sum(axis=0), data[n * size :]


def unsummed(steps):
    signed = np.where(steps % 2, -(steps.astype(np.int64) // 2) - 1, steps.astype(np.int64) // 2)
    return np.cumsum(signed, axis=-1) % 2**16


def test_the_data_are_the_overview(variants):
    recording = [variant.overviews[0] for variant in variants]
    snippets = report_data.choose_snippets([recording])[0]
    assert all(snippets)
    header, data = report_data.pack_recording(recording, 4, snippets)
    rest = zlib.decompress(base64.b64decode(data))
    first, channels, n = recording[0], 16, header['bins']
    lowest, step = np.array(header['lowest_v']), np.array(header['step_v'])
    low, high, _ = first.bins(4)
    assert n == len(low) == 1900
    steps, rest = unplaned(rest, channels * n, 2)
    codes = unsummed(steps.reshape(channels, n))
    span, rest = unplaned(rest, channels * n, 2)
    within = 0.51 * step
    assert np.all(np.abs(lowest + step * codes.T - low) <= within)
    assert np.all(np.abs(lowest + step * (codes + span.reshape(channels, n)).T - high) <= within)

    def intervals(count):
        nonlocal rest
        steps, rest = unplaned(rest, 2 * count, 8)
        return np.cumsum(steps).reshape(-1, 2)

    np.testing.assert_array_equal(intervals(header['truth']), first.truth)
    for overview, variant, mine in zip(recording, header['variants'], snippets, strict=True):
        levels, rest = unplaned(rest, channels * n, 1)
        np.testing.assert_array_equal(levels.reshape(channels, n).T, overview.bins(4)[2])
        np.testing.assert_array_equal(intervals(variant['slip']), overview.slip)
        for group, (name, on) in zip(variant['groups'], overview.groups.items(), strict=True):
            assert group['name'] == name
            np.testing.assert_array_equal(intervals(group['intervals']), on)
        assert intervals(variant['after_impact']).size == 0
        assert variant['snippets'] == [[s.start, len(s.volts)] for s in mine]
        for snippet in mine:
            rows = len(snippet.volts)
            steps, rest = unplaned(rest, channels * rows, 2)
            volts = lowest + step * unsummed(steps.reshape(channels, rows)).T
            assert np.all(np.abs(volts - snippet.volts) <= within)
            levels, rest = unplaned(rest, channels * rows, 1)
            np.testing.assert_array_equal(levels.reshape(channels, rows).T, snippet.codes)
    assert rest == b''


def test_of_evidence_the_data_have_excess_floor_and_impacts():
    volts, truth = scenes.tapped()
    seen = scenes.overview('a', scenes.EVIDENCE, volts, truth)
    header, data = report_data.pack_recording([seen], 4, [[]])
    variant, channels, n = header['variants'][0], 16, header['bins']
    assert variant['signals'] == ('level', 'excess', 'floor')
    rest = zlib.decompress(base64.b64decode(data))
    before = 2 * 2 * channels * n + 2 * 8 * header['truth']
    codes, rest = unplaned(rest[before:], 3 * channels * n, 1)
    codes = codes.reshape(3 * channels, n).T
    np.testing.assert_array_equal(codes, seen.bins(4)[2])
    result = SlipChain(scenes.EVIDENCE).update(volts, floor=True, excess=True)
    for place, found in ((1, result.excess), (2, result.floor)):
        low, high = variant['ranges_db'][variant['signals'][place]]
        mine = codes[:, place * channels : (place + 1) * channels].astype(float)
        decibels = low + (mine - 1) / 254 * (high - low)
        highest = found.reshape(n, 4, channels).max(axis=1)
        np.testing.assert_allclose(decibels, highest, rtol=0, atol=0.51 * (high - low) / 254)
    rows = np.flatnonzero(np.diff(np.concatenate([[0], result.after_impact, [0]])))
    np.testing.assert_array_equal(seen.after_impact, rows.reshape(-1, 2))
    assert variant['after_impact'] == len(rows) // 2 > 0
    assert variant['offset_db'] == scenes.EVIDENCE.evidence_offset_db


def test_a_channel_without_samples_has_none_in_the_data():
    volts, truth = scenes.volts_and_truth(500)
    volts[:, 3] = np.nan
    volts[100:200, 5] = np.nan
    seen = scenes.overview('a', scenes.GIVEN, volts, truth)
    _, data = report_data.pack_recording([seen], 1, [[]])
    steps, _ = unplaned(zlib.decompress(base64.b64decode(data)), 16 * 500, 2)
    none = unsummed(steps.reshape(16, 500)) == report_data.NO_SAMPLE
    np.testing.assert_array_equal(none.T, np.isnan(volts))


def test_all_recordings_of_a_report_share_the_room(monkeypatch):
    monkeypatch.setattr(report_data, 'MOST_BIN_CELLS', 16 * 1000)
    long, short = (
        [scenes.overview('a', scenes.GIVEN, *scenes.volts_and_truth(rows))] for rows in (4000, 300)
    )
    assert report_data.bin_rows([long, short]) == [8, 1]


def test_the_rows_of_false_alarms_and_misses_come_before_those_of_detections(
    monkeypatch, variants
):
    recordings = [[variants[0].overviews[0]]]
    window = 16 * 172
    for room, shown in ((window, 1), (3.9 * window, 3), (100 * window, 4)):
        monkeypatch.setattr(report_data, 'MOST_SNIPPET_CELLS', room)
        ((snippets,),) = report_data.choose_snippets(recordings)
        kinds = {
            event.kind
            for event in scenes.EVENTS['given']
            for s in snippets
            if s.start <= round(event.start_s * 380.0) < s.start + len(s.volts)
        }
        assert len(kinds) == shown
        assert ('detected' in kinds) == (shown == 4)


def test_very_many_intervals_are_joined_where_no_bin_lies_between(monkeypatch):
    monkeypatch.setattr(report_data, 'MOST_INTERVALS', 2)
    rows = np.array([[0, 5], [7, 9], [50, 60], [62, 70]])
    np.testing.assert_array_equal(report_data._joined(rows, 8), [[0, 9], [50, 70]])
    np.testing.assert_array_equal(report_data._joined(rows[:2], 8), rows[:2])


def costs():
    return st.one_of(st.none(), st.integers(0, 3).map(float))


@given(st.lists(st.tuples(*[costs()] * 4), max_size=12))
def test_the_front_is_what_no_trial_beats(table):
    trials = [
        SearchTrial(i, *row, None if lack is None else 1.0 - lack)
        for i, (*row, lack) in enumerate(table)
    ]
    known = [trial for trial, row in zip(trials, table, strict=True) if None not in row]

    def beaten(trial):
        mine = table[trial.number]
        return any(
            all(a <= b for a, b in zip(table[other.number], mine, strict=True))
            and table[other.number] != mine
            for other in known
        )

    assert {t.number for t in trade_off_front(trials)} == {
        t.number for t in known if not beaten(t)
    }
