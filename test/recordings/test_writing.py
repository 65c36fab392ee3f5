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

"""Writing: what is written is read back to the bit, and nothing is overwritten."""

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

pytest.importorskip('rosbags', reason='needs rosbags')

from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability

from slip_detector.chain.samples import Samples
from slip_detector.recordings import open_recording, write_recording
from slip_detector.recordings.writing import BagWriter
from support.bags import ENDINGS, NAMES, check_same, gathered, rows, save
from support.limits import full_disk


@pytest.mark.parametrize('ending', ENDINGS)
@settings(max_examples=25)
@given(data=st.data())
def test_rows_are_written_and_read_back_to_the_bit(tmp_path_factory, ending, data):
    n, channels = data.draw(st.integers(2, 40)), data.draw(st.integers(1, 5))
    any_float = st.floats(allow_nan=False, width=64) | st.just(np.nan)
    volts = data.draw(hnp.arrays(np.float64, (n, channels), elements=any_float))
    truth = data.draw(st.none() | hnp.arrays(np.bool_, n))
    start_ns = data.draw(st.integers(0, 2**60))
    steps_ns = data.draw(st.lists(st.integers(9_900_000, 10_100_000), min_size=n, max_size=n))
    stamps_ns = start_ns + np.cumsum(np.array(steps_ns, dtype=np.int64))
    written = Samples(volts, stamps_ns, truth)
    cut = data.draw(st.integers(0, n))
    pieces = [written.take(slice(cut)), written.take(slice(cut, None))]
    path = tmp_path_factory.mktemp('written') / f'trial{ending}'
    names = [f'taxel_{i}' for i in range(channels)]
    write_recording(path, [piece for piece in pieces if len(piece.volts)], 100.0, names)
    recording = open_recording(path)
    # As they were recorded: steps that add up to a drift are bridged like a gap for the chain.
    check_same(functools.reduce(Samples.then, recording.rows()), written)
    assert recording.has_truth == (truth is not None)
    assert recording.sample_rate_hz == pytest.approx(100.0, rel=0.02)
    unnamed = [f'ch{i + 1}' for i in range(channels)]
    assert list(recording.channel_names) == (unnamed if ending == '.npz' else names)


def test_the_position_of_the_platform_is_in_an_npz(tmp_path):
    path = save(tmp_path / 'a.npz', rows(300)._replace(position_m=np.arange(300.0)))
    np.testing.assert_array_equal(open_recording(path).array('position_m'), np.arange(300.0))


@pytest.mark.parametrize('ending', ['', '.mcap', '.db3'])
def test_a_bag_says_with_which_quality_its_topics_were_offered(tmp_path, ending):
    with AnyReader([save(tmp_path / f'trial{ending}', rows())]) as reader:
        offered = {one.topic: one.ext.offered_qos_profiles for one in reader.connections}
    (state,) = offered['/slip_truth']
    assert state.reliability is QosReliability.RELIABLE
    assert state.durability is QosDurability.TRANSIENT_LOCAL


def test_nothing_is_overwritten_and_no_half_recording_stays(tmp_path):
    path = save(tmp_path / 'a.mcap', rows(10))
    with pytest.raises(ValueError, match=r'a\.mcap: already exists, allowed: a new path'):
        save(path, rows(20))
    folder = tmp_path / 'of_somebody_else'
    folder.mkdir()
    (folder / 'mine.txt').write_text('mine')
    with pytest.raises(FileExistsError, match='already exists'):
        BagWriter(folder, NAMES)
    assert [file.read_text() for file in folder.iterdir()] == ['mine']

    def failing():
        yield rows(10)
        raise ValueError('the source failed')

    for ending in ENDINGS:
        with pytest.raises(ValueError, match='the source failed'):
            write_recording(tmp_path / f'b{ending}', failing(), 380.0, NAMES)
    assert sorted(file.name for file in tmp_path.iterdir()) == ['a.mcap', 'of_somebody_else']
    with pytest.raises(ValueError, match=r'bag: is \.bag, allowed: \.npz, \.csv, \.mcap, \.db3'):
        save(tmp_path / 'a.bag', rows(10))


@pytest.mark.parametrize('ending', ENDINGS)
def test_on_a_full_disk_no_half_recording_stays(tmp_path, ending):
    path = tmp_path / f'trial{ending}'
    samples = rows(5000)
    said = r'trial.*: cannot be written \((File too large|disk|database)'
    with pytest.raises(ValueError, match=said), full_disk(100_000):
        save(path, samples)
    assert not list(tmp_path.iterdir())
    assert len(gathered(open_recording(save(path, samples))).volts) == 5000


def test_a_writer_that_is_killed_loses_nothing_that_was_flushed(tmp_path):
    bag = BagWriter(tmp_path / 'trial', NAMES, accuracy_s=0.35)
    bag.write(rows(300))
    bag.flush()
    bag.write(rows(5))
    # What another reader sees now is what SIGKILL would leave.
    recording = open_recording(tmp_path / 'trial')
    check_same(gathered(recording), rows(300))
    bag.abort()
    assert recording.accuracy_s == 0.35
    assert 'cut off' in recording.counts.damage


def test_a_negative_stamp_is_refused_where_there_is_no_room_for_it(tmp_path):
    before_1970 = rows(2)._replace(stamps_ns=np.array([-10_000_000, 0]))
    bag = BagWriter(tmp_path / 'trial', NAMES)
    with pytest.raises(OSError, match='a stamp is negative'):
        bag.write(before_1970)
    bag.abort()
    bag = BagWriter(tmp_path / 'old', NAMES, ending='.db3')
    bag.write(before_1970)
    bag.close()
    assert next(open_recording(tmp_path / 'old').rows()).stamps_ns[0] == -10_000_000
