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

"""A chain whose parameters change while it runs."""

import dataclasses
import itertools
import threading
import time

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from slip_detector.chain import layout, live_chain
from slip_detector.chain.filters import settling_rows
from slip_detector.chain.live_chain import HISTORY_S, LiveChain
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from support import reference_evidence
from support.reference import reference

CONFIG = ChainConfig(sample_rate_hz=400.0, channels=4, stopbands_hz=[0.5, 7.0])
KEPT = round(HISTORY_S * 400.0)


#: Time to gather changes, instead of a tenth of a second for each example.
SHORT_S = 0.002


@pytest.fixture(autouse=True, scope='module')
def _gathered_for_a_short_time():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(live_chain, 'GATHER_S', SHORT_S)
        yield


def noise(n, seed=0, channels=4):
    random = np.random.default_rng(seed)
    return 4.0 + 0.05 * random.standard_normal((n, channels))


class Bed:
    """A live chain whose configuration changes."""

    def __init__(self, config=CONFIG):
        self.chain = LiveChain(config)

    def levels(self, rows):
        return [self.chain.update(row[None], level=True).level[0] for row in rows]

    def change(self, **values):
        return self.chain.change(dataclasses.replace(self.chain.config, **values))

    def wait_until(self, happened, timeout_s=60.0):
        """Wait for something that another thread does; return whether it was in time."""
        end_s = time.monotonic() + timeout_s
        while not (done := happened()) and time.monotonic() < end_s:
            time.sleep(1e-4)
        return done

    def swapped(self, timeout_s=60.0):
        """Swap the new chain in as soon as it is ready; return whether that was in time."""
        return self.wait_until(self.chain.swap, timeout_s)


@given(st.integers(1, 400), st.floats(1e-3, 1e3), st.sampled_from(['all', 'mean', 2]))
def test_a_new_threshold_and_vote_hold_from_the_next_row_and_leave_the_levels_alone(
    at, threshold, vote
):
    rows = noise(600)
    bed = Bed()
    flags = [bed.chain.update(rows[:at], level=False).flags]
    assert bed.change(threshold=threshold, vote=vote)
    assert bed.chain.swap()
    after = bed.chain.update(rows[at:], level=True)
    flags.append(after.flags)
    wanted_before = SlipChain(CONFIG).update(rows)
    changed = dataclasses.replace(CONFIG, threshold=threshold, vote=vote)
    wanted_after = SlipChain(changed).update(rows)
    np.testing.assert_array_equal(after.level, wanted_after.level[at:])
    wanted = np.concatenate([wanted_before.flags[:at], wanted_after.flags[at:]])
    np.testing.assert_array_equal(np.concatenate(flags), wanted)


@given(st.integers(0, 2 * KEPT), st.integers(0, 50))
def test_a_new_band_decides_as_if_it_had_run_for_the_history(before, meanwhile):
    rows = noise(before + meanwhile + 100)
    bed = Bed()
    bed.chain.update(rows[:before], level=False)
    assert not bed.change(passband_hz=(20.0, 100.0))
    old = bed.chain.update(rows[before : before + meanwhile], level=True)
    # Until the swap the old filters decide.
    np.testing.assert_array_equal(
        old.level, SlipChain(CONFIG).update(rows[: before + meanwhile]).level[before:]
    )
    assert bed.swapped()
    new = bed.chain.update(rows[before + meanwhile :], level=True)
    config = dataclasses.replace(CONFIG, passband_hz=(20.0, 100.0))
    assert bed.chain.config == config
    # One call may have brought more than the history keeps: then all of it is kept.
    wanted = SlipChain(config).update(rows).level[before + meanwhile :]
    np.testing.assert_array_equal(new.level, wanted)


def test_rows_before_a_reset_are_not_in_the_new_chain():
    rows = noise(300)
    bed = Bed()
    bed.levels(rows[:100])
    bed.change(gain=50.0)
    bed.levels(rows[100:150])
    bed.chain.reset()
    bed.levels(rows[150:200])
    assert bed.swapped()
    wanted = SlipChain(bed.chain.config).update(rows[150:]).level[50:]
    np.testing.assert_array_equal(bed.levels(rows[200:]), wanted)


@pytest.mark.parametrize(
    'values',
    [{'sample_rate_hz': 500.0}, {'channels': 3, 'groups': {}}, {'input_field': 'velocity'}],
)
def test_another_input_starts_from_its_first_row(values):
    rows = noise(300)
    bed = Bed(DetectorConfig.from_parameters(CONFIG.to_parameters()))
    bed.levels(rows[:200])
    assert not bed.change(**values)
    assert bed.swapped()
    rows = rows[200:, : bed.chain.config.channels]
    wanted = SlipChain(bed.chain.config).update(rows).level
    np.testing.assert_array_equal(bed.levels(rows), wanted)


@pytest.fixture
def timers(monkeypatch):
    """Return the timers that a chain starts; each goes off when the test says so."""
    made = []

    class ByHand(threading.Timer):
        def start(self):
            made.append(self)

        def go_off(self):
            wait_s, self.interval = self.interval, 0.0
            super().start()
            self.join()
            return wait_s

    monkeypatch.setattr(threading, 'Timer', ByHand)
    return made


def test_what_is_changed_within_a_short_time_is_built_once_after_the_last_order(
    timers, monkeypatch
):
    bed, built = Bed(), []

    class Counted(SlipChain):
        def __init__(self, config):
            built.append(config)
            super().__init__(config)

    monkeypatch.setattr(live_chain, 'SlipChain', Counted)
    config = CONFIG
    for values in ({'gain': 10.0}, {'threshold': 2.0}, {'passband_hz': (20.0, 100.0)}, {}):
        config = dataclasses.replace(config, **values)  # The last is ordered once more.
        assert not bed.chain.change(config)
    for timer in timers[:-1]:
        timer.go_off()
    assert not bed.chain.swap()
    timers[-1].go_off()
    assert bed.chain.swap()
    assert built == [config]
    assert bed.chain.config == config


def test_changes_that_never_end_are_used_all_the_same(timers, monkeypatch):
    monkeypatch.setattr(live_chain, 'GATHER_S', 4.0)
    monkeypatch.setattr(live_chain, 'GATHER_AT_MOST_S', 10.0)
    bed, waits_s = Bed(), []
    for now_s in (0.0, 3.0, 6.0, 9.0, 12.0):
        monkeypatch.setattr(time, 'monotonic', lambda now_s=now_s: now_s)
        bed.change(gain=10.0, threshold=1.0 + now_s)
        waits_s.append(timers[-1].interval)
    timers[-1].go_off()
    # From the first order on it is never longer than at most.
    assert waits_s == [4.0, 4.0, 4.0, 1.0, 0.0]
    assert bed.chain.swap()


@pytest.mark.parametrize('back', [False, True])
def test_what_is_built_is_used_though_changes_go_on_unless_it_is_taken_back(
    timers, monkeypatch, back
):
    bed, gains = Bed(), itertools.count(1)

    def change():
        return bed.change(gain=CONFIG.gain if back else next(gains))

    class Slow(SlipChain):
        def __init__(self, config):
            change()
            super().__init__(config)

    bed.change(gain=next(gains))
    monkeypatch.setattr(live_chain, 'SlipChain', Slow)
    for gain in [CONFIG.gain] if back else [1, 3, 5]:
        timers[-1].go_off()
        change()
        assert bed.chain.swap()
        assert bed.chain.config.gain == gain
    assert not bed.chain.swap()


def test_rows_come_in_one_thread_while_another_changes_the_configuration():
    rows = noise(4000)
    bed = Bed()
    results = []
    swaps = 0

    def run():
        # On a busy machine all rows may have come before the other thread runs.
        while len(results) < len(rows) or (not swaps and len(results) < 100 * len(rows)):
            row = rows[len(results) % len(rows)]
            results.append(bed.chain.update(row[None], level=True))

    thread = threading.Thread(target=run)
    thread.start()
    while thread.is_alive():
        for values in ({'threshold': 1e-6}, {'gain': 50.0}, {'gain': 100.0, 'threshold': 0.5}):
            bed.change(**values)
            swaps += bed.swapped(1.0)
    thread.join()
    assert len(results) >= len(rows)
    assert all(np.isfinite(result.level).all() for result in results)
    assert swaps
    # As if the configuration of the end had always been there.
    wanted = SlipChain(bed.chain.config).update(np.concatenate([rows, rows])).level[-100:]
    np.testing.assert_allclose(bed.levels(rows)[-100:], wanted, rtol=1e-4)


def test_taking_a_change_back_before_it_was_built_leaves_all_as_it_was():
    rows = noise(300)
    bed = Bed()
    bed.levels(rows[:200])
    bed.change(gain=10.0)
    assert bed.change(gain=CONFIG.gain)
    assert bed.chain.swap()
    assert not bed.swapped(50 * SHORT_S)
    np.testing.assert_array_equal(
        bed.levels(rows[200:]), SlipChain(CONFIG).update(rows).level[200:]
    )


EVIDENCE = dataclasses.replace(
    CONFIG, decision='evidence', noise_floor=1e-9, threshold=0.1, noise_floor_rate_db_s=30.0
)


def state_of(bed):
    return bed.chain._chain.state


VALUES = {
    'impact_channels': st.integers(1, 2),
    'impact_hold_s': st.sampled_from([0.0, 0.05, 0.5]),
    'noise_floor': st.sampled_from([1e-4, 2e-4, (1e-4, 3e-4, 5e-4, 1e-3)]),
    'noise_floor_learnt': st.booleans(),
    'noise_floor_range_db': st.sampled_from([0.0, 3.0, 15.0]),
    'evidence_cap_db': st.sampled_from([11.0, 20.0]),
    'evidence_offset_db': st.sampled_from([2.0, 5.0, 9.0]),
    'evidence_limit_db_s': st.sampled_from([0.4, 1.3]),
    'threshold': st.sampled_from([0.05, 0.3]),
}


@st.composite
def changes(draw):
    """Draw parameters of evidence, in the order in which they hold, and from which row on."""
    values, changed = draw(st.fixed_dictionaries(VALUES)), []
    for row in sorted({0, *draw(st.lists(st.integers(1, 599), min_size=2, max_size=6))}):
        name = draw(st.sampled_from(sorted(VALUES)))
        impact_v = draw(st.sampled_from([0.0, 0.2, 5.0]))
        values = values | {name: draw(VALUES[name]), 'impact_v': impact_v}
        changed.append((row, values))
    return changed


#: What remains of a hold when impacts are switched off is gone when they are switched on again.
HELD = {'impact_channels': 1, 'impact_hold_s': 0.5}


@example(
    changed=[(row, HELD | {'impact_v': v}) for row, v in [(0, 0.2), (300, 0.0), (310, 5.0)]],
    seed=0,
)
@given(changed=changes(), seed=st.integers(0, 99))
def test_evidence_whose_parameters_change_follows_its_equations_row_by_row(changed, seed):
    """The equations are those of docs/method.md, with the parameters of each row."""
    volts, levels = noise(600, seed), []
    volts[200:400] += 0.2 * (volts[200:400] - 4.0)
    still = {'noise_floor_rate_db_s': 0.0, 'exponent': 1, 'gain': 1.0}
    configs = [dataclasses.replace(EVIDENCE, **still | values) for _, values in changed]
    ends = [row for row, _ in changed[1:]] + [600]
    bed = Bed(configs[0])
    level_db = reference_evidence.decibels(reference(volts, configs[0]).envelope)
    evidence, wanted, left, floor_db = np.zeros(4), [], 0, np.full(4, np.nan)
    if configs[0].noise_floor_learnt:
        floor_db = 20 * np.log10(configs[0].noise_floor)
    for config, (begin, _), end in zip(configs, changed, ends, strict=True):
        assert config == bed.chain.config or (bed.chain.change(config) and bed.chain.swap())
        levels.extend(bed.chain.update(volts[begin:end], level=True).level)
        least_db = 20 * np.log10(config.noise_floor)
        for row in range(begin, end):
            steps = np.abs(volts[row] - volts[max(row - 1, 0)]) > config.impact_v
            left = min(left - 1, config.samples(config.impact_hold_s)) if config.impact_v else 0
            if config.impact_v and steps.sum() >= config.impact_channels:
                left = config.samples(config.impact_hold_s)
            if row >= config.samples(config.envelope_window_s):
                floor_db = np.where(np.isnan(floor_db), level_db[row], floor_db)
                floor_db = np.clip(floor_db, least_db, least_db + config.noise_floor_range_db)
                excess_db = np.clip(level_db[row] - floor_db, -8.7, config.evidence_cap_db)
                gain = (excess_db * (left <= 0) - config.evidence_offset_db) / 400.0
                evidence = np.clip(evidence + gain, 0.0, config.evidence_limit_db_s)
            wanted.append(evidence)
    np.testing.assert_allclose(levels, wanted, rtol=0, atol=1e-4)


SLIDING = dataclasses.replace(
    EVIDENCE, exponent=1, noise_floor=0.01, noise_floor_rate_db_s=0.43, vote=2,
    passband_hz=(20.0, 150.0), stopbands_hz=(), evidence_offset_db=7.0,
)  # fmt: skip


@pytest.mark.parametrize(
    'values',
    [
        {'passband_hz': (60.0, 0.0)},
        {'passband_degree': 2, 'stopbands_hz': (45.0, 55.0)},
        {'gain': 5.0},
        {'mains_hz': 50.0},
        {'common_mode': 'median'},
        {'rectify': 'half', 'exponent': 2, 'evidence_offset_db': 12.0},
        {'envelope_window_s': 0.1},
        {'disabled_channels': (3,), 'groups': {}},
        {'contact_level_v': 0.001, 'contact_channels': 2},
        {'activity_cap_db': 8.7},
        {'impact_v': 9.0, 'impact_s': 0.02},
    ],
)
@pytest.mark.parametrize('gap', [False, True])
def test_a_slide_stays_on_and_rest_is_rest_whatever_changes_late_in_it(values, gap):
    """After a gap no row at rest is known: how far slip is above the floor tells the new floor."""
    rows = np.concatenate([noise(4000), 4.0 + 10 * (noise(4400, 1) - 4.0), noise(2000, 2)])
    bed, slip = Bed(SLIDING), []
    for at in range(0, len(rows), 40):
        if at == 4000 and gap:
            bed.chain.restart()
        if at == 6800:
            bed.change(**values)
            assert bed.swapped()
        slip.append(bed.chain.update(rows[at : at + 40], level=False).slip)
    slip = np.concatenate(slip)
    assert not slip[3000:4000].any()
    assert slip[4100:8400].all()
    assert not slip[9000:].any()


BOTH = dataclasses.replace(
    SLIDING, contact_level_v=0.01, contact_channels=2, contact_hold_s=0.5, activity_cap_db=8.7
)


@given(
    st.sampled_from([0.0, 0.01, 0.1]),
    st.sampled_from([0.0, 0.5]),
    st.floats(3.0, 8.7),
    st.integers(0, 600),
)
def test_contact_and_activity_change_at_once_and_go_on_from_where_they_are(
    level_v, hold_s, cap_db, at
):
    rows, bed, before = noise(700, 3), Bed(BOTH), SlipChain(BOTH)
    bed.chain.update(rows[:at], level=False)
    before.update(rows[:at])
    values = {'contact_level_v': level_v, 'contact_hold_s': hold_s, 'activity_cap_db': cap_db}
    assert bed.change(**values)
    assert bed.chain.swap()
    found = bed.chain.update(rows[at:], level=True)
    after = SlipChain(dataclasses.replace(BOTH, **values))
    after.state = before.state.copy()
    np.testing.assert_array_equal(found.level, after.update(rows[at:]).level)


def test_contact_that_was_switched_off_begins_anew_and_what_needs_other_state_is_built():
    bed = Bed(dataclasses.replace(BOTH, contact_hold_s=60.0))
    bed.chain.update(noise(400), level=False)
    assert state_of(bed)[0, layout.CONTACT_ROWS, 0] > 0
    for level_v in (0.0, 1e6):
        assert bed.change(contact_level_v=level_v)
        assert bed.chain.swap()
    assert state_of(bed)[0, layout.CONTACT_ROWS, 0] == 0
    slots = state_of(bed).shape[1]
    none = {'contact_level_v': 0.0, 'activity_cap_db': 0.0}
    for values in ({'activity_band_hz': (9.0, 15.0)}, none):
        assert not bed.change(**values)
        assert bed.swapped()
    assert state_of(bed).shape[1] < slots


def test_a_change_of_gain_scales_the_floors_and_one_channel_less_keeps_those_of_the_others():
    bed = Bed(SLIDING)
    bed.chain.update(noise(3 * KEPT), level=False)
    for values, db in (
        ({'gain': 50.0}, 20 * np.log10(0.5)),
        ({'disabled_channels': (3,), 'groups': {}}, 0.0),
        ({'disabled_channels': (), 'groups': {}}, 0.0),
    ):
        before = state_of(bed)[0, layout.FLOOR, :4].copy()
        bed.change(**values)
        assert bed.swapped()
        after = state_of(bed)[0, layout.FLOOR, :4]
        assert after[[0, 1, 3]] == pytest.approx(before[[0, 1, 3]] + db, abs=1e-3)
    # One that is enabled again begins where it would settle.
    assert after[2] == pytest.approx(before[0], abs=6.0)


def test_a_gap_keeps_the_floors_and_a_reset_does_not():
    bed = Bed(EVIDENCE)
    bed.chain.update(noise(400), level=False)
    before = state_of(bed)[0, layout.FLOOR, :4].copy()
    assert np.isfinite(before).all()
    bed.chain.restart()
    np.testing.assert_array_equal(state_of(bed)[0, layout.FLOOR, :4], before)
    assert not bed.chain._history
    # Nor does a chain that was built before the reset, and is swapped in after it.
    bed.change(gain=50.0)
    assert bed.wait_until(lambda: bed.chain._ready)
    bed.chain.reset()
    assert np.isnan(state_of(bed)[0, layout.FLOOR, :4]).all()
    assert bed.chain.swap()
    assert np.isnan(state_of(bed)[0, layout.FLOOR, :4]).all()


@pytest.mark.parametrize(
    ('before', 'values', 'wanted'),
    [
        (300, {'threshold': 0.1}, 1),
        (KEPT, {'gain': 50.0}, 1),
        (0, {'gain': 50.0}, settling_rows(CONFIG)),
        (50, {'gain': 50.0}, settling_rows(CONFIG) - 50),
        (KEPT, {'channels': 3, 'groups': {}}, settling_rows(CONFIG)),
        (KEPT, {'passband_hz': (0.1, 100.0)}, 1),
    ],
)
def test_it_is_told_how_long_slip_may_come_of_the_change(before, values, wanted):
    bed = Bed()
    bed.chain.update(noise(before), level=False)
    assert bed.chain.unsettled_rows == 0
    bed.change(**values)
    assert bed.chain.unsettled_rows == 0
    assert bed.swapped()
    assert bed.chain.unsettled_rows == wanted
    channels = bed.chain.config.channels
    bed.chain.update(noise(wanted, channels=channels)[1:], level=False)
    assert bed.chain.unsettled_rows == 1
    bed.chain.update(noise(5, channels=channels), level=False)
    assert bed.chain.unsettled_rows == 0


def test_a_change_of_evidence_has_the_time_that_evidence_takes():
    bed = Bed(EVIDENCE)
    assert bed.change(evidence_offset_db=2.0)
    assert bed.chain.swap()
    assert bed.chain.unsettled_rows == round(1.3 / 2.0 * 400.0)
