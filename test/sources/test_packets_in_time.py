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

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.sources.packets import MOST_BEHIND
from support.packet_cases import PERIOD_US, decoder, integers, packets, sent_by
from support.reference_packets import on_the_line, packet


@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_numbers_and_times_may_wrap(first, n):
    receiver = decoder(channels=1)
    received = []
    for k in range(n):
        # Both counters wrap somewhere near, at different packets.
        sequence, time_us = (first + k) % 2**32, (2**32 - 2500 + k * PERIOD_US) % 2**32
        received += receiver.feed(on_the_line(packet([[k]], 'int16', sequence, time_us)))
    times_ns = [r.stamps_ns[0] for r in received]
    assert np.diff(times_ns).tolist() == [PERIOD_US * 1000] * (n - 1)
    assert [r.new_stretch for r in received] == [True] + [False] * (n - 1)
    assert not receiver.counts['lost']


@given(st.randoms(use_true_random=False))
def test_any_order_of_datagrams_gives_samples_in_order_and_counts_the_rest(rng):
    sent = packets(60)
    came = sorted(sent * 2, key=lambda packet: sent.index(packet) + rng.uniform(0, 12))
    came = sent[:1] + [packet for packet in came if rng.random() > 0.2]
    receiver = decoder()
    received = [samples for each in came for samples in receiver.decode(each)]
    taken = integers(received)
    wanted = sent_by(*sent)
    assert taken == [row for row in wanted if row in taken]
    counts = receiver.counts
    assert counts['packets'] + counts['late'] == len(came)
    first, last = wanted.index(taken[0]), wanted.index(taken[-1])
    assert counts['packets'] + counts['lost'] == last - first + 1


def test_a_sender_that_began_again_is_believed():
    receiver = decoder()
    for sent in packets(10, first=MOST_BEHIND):
        assert receiver.decode(sent)
    received = [samples for sent in packets(400) for samples in receiver.decode(sent)]
    assert integers(received) == sent_by(*packets(400))
    assert [r.new_stretch for r in received] == [True] + [False] * (len(received) - 1)
    assert receiver.counts['restarts'] == 1
    assert receiver.counts['lost'] == receiver.counts['late'] == 0


def test_samples_that_begin_before_the_end_of_the_packet_before_are_spread_behind_it():
    receiver = decoder(channels=1)

    def times_us(sequence, time_us, n):
        sent = packet(np.ones((n, 1)), 'int16', sequence, time_us, PERIOD_US * 1000)
        return [(samples.stamps_ns / 1000).tolist() for samples in receiver.decode(sent)]

    assert times_us(0, 0, 4) == [[0, 1000, 2000, 3000]]
    assert times_us(1, 2000, 4) == [[3500, 4000, 4500, 5000]]
    assert times_us(2, 4000, 1) == []  # There is no time left for it.
    assert times_us(3, 6000, 2) == [[6000, 7000]]
    wanted = {'packets': 3, 'samples': 10, 'overlap': 1, 'no_time': 1}
    assert {name: receiver.counts[name] for name in (*wanted, 'lost')} == {**wanted, 'lost': 0}
