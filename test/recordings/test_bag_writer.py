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


"""Bags that are written as their rows come, and what is left of them when the writer ends."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.recordings import open_recording
from slip_detector.recordings.bag_writer import BagWriter
from support.full_disk import full_disk

N = 300


def rows(first, n=N):
    """Rows that tell their number, with slip in each odd hundred."""
    number = np.arange(first, first + n)
    volts = np.stack([number, -number], axis=1).astype(float)
    return Samples(volts, number * 1_000_000, (number // 100) % 2 == 1)


def read(path):
    """Return the rows of a recording, its truth, and what of it is lost."""
    recording = open_recording(path)
    pieces = [*recording.pieces()]
    volts = np.concatenate([piece.volts for piece in pieces])
    return volts, np.concatenate([piece.truth for piece in pieces]), recording.counts.damage


@pytest.mark.parametrize('ending', ['.mcap', '.db3'])
def test_pieces_are_read_back_with_their_truth(tmp_path, ending):
    bag = BagWriter(tmp_path / 'trial', ['a', 'b'], ending=ending)
    for first in range(0, 3 * N, N):
        bag.write(rows(first))
    bag.close()
    volts, truth, lost = read(tmp_path / 'trial')
    assert volts[:, 0].tolist() == [*range(3 * N)]
    np.testing.assert_array_equal(truth, rows(0, 3 * N).truth)
    assert not lost


def test_what_was_flushed_can_be_read_while_the_bag_is_written(tmp_path):
    bag = BagWriter(tmp_path / 'trial', ['a', 'b'])
    for first in range(0, 3 * N, N):
        bag.write(rows(first))
        bag.flush()
        volts, truth, _ = read(bag.path)
        assert len(volts) == first + N
        np.testing.assert_array_equal(truth, rows(0, first + N).truth)
    bag.close()


def test_a_flush_without_rows_writes_nothing(tmp_path):
    bag = BagWriter(tmp_path / 'trial', ['a', 'b'])
    bag.write(rows(0))
    bag.flush()
    size = bag.path.stat().st_size
    bag.flush()
    assert bag.path.stat().st_size == size
    bag.close()


def test_a_writer_that_is_killed_loses_nothing_that_was_flushed(tmp_path):
    program = (
        'import sys, time\n'
        'from pathlib import Path\n'
        'from recordings.test_bag_writer import BagWriter, rows\n'
        "bag = BagWriter(Path(sys.argv[1]), ['a', 'b'])\n"
        'bag.write(rows(0))\n'
        'bag.flush()\n'
        'bag.write(rows(300, 5))\n'
        "print('flushed', flush=True)\n"
        'time.sleep(600)\n'
    )
    writer = subprocess.Popen(
        [sys.executable, '-c', program, str(tmp_path / 'trial')],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {'PYTHONPATH': os.pathsep.join(sys.path)},
    )
    with writer:
        assert writer.stdout.readline() == 'flushed\n'
        writer.send_signal(signal.SIGKILL)
    volts, truth, lost = read(tmp_path / 'trial')
    assert len(volts) == N
    np.testing.assert_array_equal(truth, rows(0).truth)
    assert 'cut off' in lost


def test_a_folder_that_somebody_else_has_made_is_left_as_it_is(tmp_path):
    (tmp_path / 'trial').mkdir()
    (tmp_path / 'trial' / 'mine.txt').write_text('mine')
    with pytest.raises(FileExistsError, match='already exists'):
        BagWriter(tmp_path / 'trial', ['a', 'b'])
    assert [path.name for path in (tmp_path / 'trial').iterdir()] == ['mine.txt']


def test_a_negative_stamp_is_refused_where_there_is_no_room_for_it(tmp_path):
    before_1970 = rows(0)._replace(stamps_ns=rows(-1).stamps_ns)
    bag = BagWriter(tmp_path / 'trial', ['a', 'b'])
    with pytest.raises(OSError, match='a stamp is negative'):
        bag.write(before_1970)
    bag.abort()
    bag = BagWriter(tmp_path / 'old', ['a', 'b'], ending='.db3')
    bag.write(before_1970)
    bag.close()
    assert next(open_recording(tmp_path / 'old').rows()).stamps_ns[0] == -1_000_000


def test_a_full_disk_raises_and_keeps_what_was_flushed(tmp_path):
    bag = BagWriter(tmp_path / 'trial', ['a', 'b'])
    bag.write(rows(0))
    bag.flush()
    with full_disk(bag.path.stat().st_size + 1000):
        bag.write(rows(N))
        with pytest.raises(OSError, match='File too large'):
            bag.flush()
        with pytest.raises(OSError, match='File too large'):
            bag.close()
    volts, truth, lost = read(bag.path)
    assert len(volts) >= N
    np.testing.assert_array_equal(volts, rows(0, len(volts)).volts)
    np.testing.assert_array_equal(truth, rows(0, len(volts)).truth)
    assert 'cut off' in lost
