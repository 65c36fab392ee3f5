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

"""Packets that are lost, come twice, late or after a restart, and the times of their samples."""

from collections import Counter

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.sources.cobs import cobs_encode
from slip_detector.sources.packets import RESTART_US, encode
from support.packet_cases import PERIOD_US, decoder, integers, on_the_line, packets, sent_by


@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_numbers_and_times_may_wrap(first, n):
    receiver = decoder(channels=1)
    received = []
    for k in range(n):
        # Both counters wrap somewhere near, at different packets.
        sequence, time_us = (first + k) % 2**32, (2**32 - 2500 + k * PERIOD_US) % 2**32
        received += receiver.feed(cobs_encode(encode([[k]], 'int16', sequence, time_us)) + b'\0')
    times_ns = [r.times_ns[0] for r in received]
    assert np.diff(times_ns).tolist() == [PERIOD_US * 1000] * (n - 1)
    assert [r.clock_restarted for r in received] == [True] + [False] * (n - 1)
    assert not receiver.counts['lost']


def test_lost_packets_are_counted():
    sent = packets(100)
    receiver = decoder()
    received = receiver.feed(on_the_line(sent[:10] + sent[11:50] + sent[57:]))
    assert receiver.counts['lost'] == 8
    assert integers(received) == sent_by(*sent[:10], *sent[11:50], *sent[57:])


def test_duplicates_and_latecomers_are_dropped():
    sent = packets(200)
    order = [0, 0, 1, 2, 1, 5, 3, 4, 4, 6, 150, 6, 10, 151]
    receiver = decoder()
    received = receiver.feed(on_the_line([sent[k] for k in order]))
    assert integers(received) == sent_by(*(sent[k] for k in [0, 1, 2, 5, 6, 150, 151]))
    assert receiver.counts['duplicate'] == 3  # the second 0, 1 and 4
    assert receiver.counts['late'] == 4  # 3 and 4; 6 and 10 behind 150 are too old to tell
    assert receiver.counts['lost'] == 2 + 143
    assert not receiver.counts['restarts']


@given(st.randoms(use_true_random=False))
def test_any_order_of_datagrams_gives_samples_in_order_and_counts_the_rest(rng):
    sent = packets(60)
    came = sorted(sent * 2, key=lambda packet: sent.index(packet) + rng.uniform(0, 12))
    came = sent[:1] + [packet for packet in came if rng.random() > 0.2]
    receiver = decoder()
    received = [r for r in map(receiver.decode, came) if r]
    taken = integers(received)
    wanted = sent_by(*sent)
    assert taken == [row for row in wanted if row in taken]
    counts = receiver.counts
    assert counts['packets'] + counts['duplicate'] + counts['late'] == len(came)
    first, last = wanted.index(taken[0]), wanted.index(taken[-1])
    assert counts['packets'] + counts['lost'] == last - first + 1


def test_a_sender_that_began_again_is_believed_after_a_while():
    receiver = decoder()
    before = packets(10, first=5000)
    after = packets(400)
    assert len([r for r in map(receiver.decode, before) if r]) == 10
    received = [r for r in map(receiver.decode, after) if r]
    assert integers(received) == sent_by(*after[RESTART_US // PERIOD_US :])
    assert [r.clock_restarted for r in received] == [True] + [False] * (len(received) - 1)
    assert receiver.counts['restarts'] == 1
    assert receiver.counts['lost'] == 0


def test_packets_that_come_out_of_the_past_are_no_new_beginning():
    receiver = decoder()
    sent = packets(2000)
    # Rising, and further apart than a sender takes to be believed; but most are missing between.
    order = [1000, 100, 500, 900, 1001, *range(700, 100, -1), 1002]
    received = [r for r in (receiver.decode(sent[k]) for k in order) if r]
    assert integers(received) == sent_by(sent[1000], sent[1001], sent[1002])
    assert receiver.counts['restarts'] == 0


def test_a_sender_that_began_again_is_believed_though_packets_are_lost():
    receiver = decoder()
    assert all(map(receiver.decode, packets(10, first=5000)))
    after = [packet for k, packet in enumerate(packets(400)) if k % 4 == 0]
    received = [r for r in map(receiver.decode, after[:64]) if r]
    # What came before the reset is no measure of what came since.
    assert receiver.decode(packets(1, first=251)[0]) is None
    assert receiver.counts['duplicate'] == 0
    received += [r for r in map(receiver.decode, after[64:]) if r]
    assert integers(received) == sent_by(*after[63:])  # From 252 ms on.


def test_a_sender_that_does_not_count_is_not_heard():
    receiver = decoder(channels=1)
    received = [receiver.decode(encode([[k]], 'int16', 0, 1000 * k)) for k in range(1000)]
    assert [r is not None for r in received] == [True] + [False] * 999
    assert receiver.counts['duplicate'] == 999


def test_old_packets_among_fresh_ones_are_no_new_beginning():
    receiver = decoder()
    old, fresh = packets(1000), packets(1000, first=2000)
    received = []
    for k in range(1000):
        received += [r for r in (receiver.decode(fresh[k]), receiver.decode(old[k])) if r]
    assert integers(received) == sent_by(*fresh)
    assert receiver.counts['restarts'] == 0


def test_each_packet_of_a_sender_without_a_clock_restarts_its_times():
    receiver = decoder(channels=1)
    received = [receiver.decode(encode([[k]], 'int16', k, 0)) for k in range(4)]
    assert all(r.clock_restarted for r in received)


@given(
    st.lists(
        st.tuples(st.integers(1, 5000), st.integers(1, 20), st.integers(1, 2_000_000)),
        min_size=1,
        max_size=80,
    )
)
def test_times_rise_strictly_though_packets_overlap_in_time(sent):
    receiver = decoder(channels=1)
    time_us, before_ns, times_ns, counts = 0, -1, [], Counter()
    for sequence, (step_us, n, period_ns) in enumerate(sent):
        time_us += step_us
        first_ns = 1000 * (time_us - sent[0][0])
        last_ns = first_ns + (n - 1) * period_ns
        got = receiver.decode(encode(np.ones((n, 1)), 'int16', sequence, time_us, period_ns))
        if last_ns - before_ns < n:
            counts['no_time'] += 1
            assert got is None
            continue
        assert len(got.times_ns) == n
        assert got.times_ns[-1] == last_ns
        if first_ns <= before_ns:
            counts['overlap'] += 1
            assert np.ptp(np.diff([before_ns, *got.times_ns])) <= 1
        else:
            assert got.times_ns[0] == first_ns
        before_ns = last_ns
        times_ns += got.times_ns
    assert np.all(np.diff(times_ns) > 0)
    assert {name: receiver.counts[name] for name in ('no_time', 'overlap')} == {
        name: counts[name] for name in ('no_time', 'overlap')
    }
    assert receiver.counts['packets'] + counts['no_time'] == len(sent)
    assert not receiver.counts['lost']


def test_a_packet_that_was_sent_late_costs_no_sample():
    receiver = decoder(channels=1)
    sent_us = [0, 10_000, 27_000, 30_000, 40_000]  # the third one was held up for 7 ms
    times_ns = []
    for sequence, time_us in enumerate(sent_us):
        packet = encode(np.ones((10, 1)), 'int16', sequence, time_us, 1_000_000)
        times_ns += receiver.decode(packet).times_ns
    assert len(times_ns) == 50
    assert np.all(np.diff(times_ns) > 0)
    assert times_ns[-1] == 49_000_000
    assert receiver.counts == Counter(packets=5, samples=50, overlap=1)
