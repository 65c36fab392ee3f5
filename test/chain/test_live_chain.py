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
import threading
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain import layout, live_chain
from slip_detector.chain.filters import settling_rows
from slip_detector.chain.live_chain import HISTORY_S, LiveChain
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig, DetectorConfig

CONFIG = ChainConfig(sample_rate_hz=400.0, channels=4, stopbands_hz=[0.5, 7.0])
KEPT = round(HISTORY_S * 400.0)


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


@pytest.mark.parametrize('back', [False, True])
def test_of_orders_while_a_chain_is_built_the_last_is_next_unless_all_is_taken_back(
    monkeypatch, back
):
    bed, built, begun, go_on = Bed(), [], threading.Event(), threading.Event()
    threads = threading.active_count()

    class Slow(SlipChain):
        def __init__(self, config):
            if threading.current_thread() is not threading.main_thread():
                begun.set()
                go_on.wait(60.0)
                built.append(config.gain)
            super().__init__(config)

    monkeypatch.setattr(live_chain, 'SlipChain', Slow)
    assert not bed.change(gain=1.0)
    assert begun.wait(60.0)
    for gain in (2.0, 3.0):
        assert not bed.change(gain=gain)
    if back:
        assert bed.change(threshold=0.1)
    go_on.set()
    assert bed.wait_until(lambda: threading.active_count() == threads)
    assert bed.chain.swap()
    assert bed.chain.config.gain == (CONFIG.gain if back else 3.0)
    assert built == ([1.0] if back else [1.0, 3.0])
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


EVIDENCE = dataclasses.replace(
    CONFIG, decision='evidence', noise_floor=1e-9, threshold=0.1, noise_floor_rate_db_s=30.0
)


def state_of(bed):
    return bed.chain._chain.state


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
    SLIDING, contact_level_v=0.01, contact_channels=2, contact_hold_s=0.5, activity_cap_db=8.7,
    impact_v=0.2, impact_channels=1, impact_hold_s=0.5,
)  # fmt: skip


#: Values of parameters that change at once, in a chain with all that evidence may have.
AT_ONCE = {
    'threshold': [0.05, 0.3],
    'vote': ['all', 'mean', 2],
    'impact_v': [0.2, 5.0],
    'impact_channels': [1, 2],
    'impact_hold_s': [0.0, 0.05, 0.5],
    'noise_floor': [(), 1e-4, (1e-4, 3e-4, 5e-4, 1e-3)],
    'noise_floor_learnt': [False, True],
    'noise_floor_range_db': [0.0, 15.0],
    'evidence_cap_db': [11.0, 20.0],
    'evidence_offset_db': [2.0, 9.0],
    'evidence_limit_db_s': [0.4, 1.3],
    'contact_level_v': [0.01, 0.1],
    'contact_hold_s': [0.0, 0.5],
    'activity_cap_db': [3.0, 8.7],
}


@given(
    st.fixed_dictionaries(
        {}, optional={name: st.sampled_from(values) for name, values in AT_ONCE.items()}
    ),
    st.integers(0, 600),
)
def test_what_only_decides_changes_from_the_next_row_on_and_goes_on_from_where_it_is(values, at):
    rows, bed, before = noise(700, 3), Bed(BOTH), SlipChain(BOTH)
    rows[200:400] += 0.2 * (rows[200:400] - 4.0)
    found = [bed.chain.update(rows[:at], level=True)]
    wanted = [before.update(rows[:at])]
    assert bed.change(**values)
    assert bed.chain.swap()
    found.append(bed.chain.update(rows[at:], level=True))
    after = SlipChain(dataclasses.replace(BOTH, **values))
    after.state = before.state.copy()
    wanted.append(after.update(rows[at:]))
    for result, expected in zip(found, wanted, strict=True):
        np.testing.assert_array_equal(result.level, expected.level)
        np.testing.assert_array_equal(result.flags, expected.flags)


def test_floors_that_nobody_gave_begin_at_rest_not_where_the_sensor_stood_still():
    bed = Bed()
    rows = noise(KEPT)
    rows[KEPT // 2 : KEPT // 2 + 390] = rows[KEPT // 2]  # less than flat_after_s
    bed.chain.update(rows, level=False)
    bed.change(decision='evidence')
    assert bed.swapped()
    level = SlipChain(CONFIG).update(rows).envelope[-100:].mean(axis=0)
    floor_db = state_of(bed)[0, layout.FLOOR, :4]
    assert np.abs(floor_db - 20 * np.log10(level)).max() < 20


def test_holds_that_were_switched_off_begin_anew_and_what_needs_other_state_is_built():
    bed = Bed(dataclasses.replace(BOTH, contact_hold_s=60.0, impact_hold_s=60.0))
    bed.chain.update(noise(400), level=False)
    holds = [layout.CONTACT_ROWS, layout.HOLD_ROWS]
    assert (state_of(bed)[0, holds, 0] > 0).all()
    for volts in (0.0, 1e6):
        assert bed.change(contact_level_v=volts, impact_v=volts)
        assert bed.chain.swap()
    assert (state_of(bed)[0, holds, 0] == 0).all()
    slots = state_of(bed).shape[1]
    none = {'contact_level_v': 0.0, 'activity_cap_db': 0.0}
    for values in ({'activity_band_hz': (9.0, 15.0)}, none):
        assert not bed.change(**values)
        assert bed.swapped()
    assert state_of(bed).shape[1] < slots


def test_a_reset_forgets_the_floors_of_a_chain_that_was_built_before_it_too():
    bed = Bed(EVIDENCE)
    bed.chain.update(noise(400), level=False)
    assert np.isfinite(state_of(bed)[0, layout.FLOOR, :4]).all()
    bed.change(gain=50.0)
    assert bed.wait_until(lambda: bed.chain._ready)
    bed.chain.reset()
    assert np.isnan(state_of(bed)[0, layout.FLOOR, :4]).all()
    assert bed.chain.swap()
    assert np.isnan(state_of(bed)[0, layout.FLOOR, :4]).all()


@pytest.mark.parametrize(
    ('config', 'before', 'values', 'wanted'),
    [
        (CONFIG, 300, {'threshold': 0.1}, 1),
        (CONFIG, KEPT, {'gain': 50.0}, 1),
        (CONFIG, 0, {'gain': 50.0}, settling_rows(CONFIG)),
        (CONFIG, 50, {'gain': 50.0}, settling_rows(CONFIG) - 50),
        (CONFIG, KEPT, {'channels': 3, 'groups': {}}, settling_rows(CONFIG)),
        (CONFIG, KEPT, {'passband_hz': (0.1, 100.0)}, 1),
        # The time that evidence takes.
        (EVIDENCE, 0, {'evidence_offset_db': 2.0}, round(1.3 / 2.0 * 400.0)),
    ],
)
def test_it_is_told_how_long_slip_may_come_of_the_change(config, before, values, wanted):
    bed = Bed(config)
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
