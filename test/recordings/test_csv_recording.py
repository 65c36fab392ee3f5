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

"""Recordings in csv files: what comes in comes out, and what is wrong is said in one line."""

import glob
import os

import numpy as np
import pytest

from support.recorded import complaint, read_recording, save_text

COLUMNS = ': line 1 has the columns '
NAMED = 'time_s and one for each channel, each with a name of its own'
TIMES = ': the times in column time_s do not rise, allowed: two or more rows, each with its time'


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('', f'{COLUMNS}none, allowed: {NAMED}'),
        ('t,a\n0,1\n', f'{COLUMNS}t, a, allowed'),
        ('time_s,a,a\n0,1,1\n1,2,2\n', f'{COLUMNS}time_s, a, a, allowed'),
        ('time_s,slip\n0,1\n1,1\n', f'{COLUMNS}time_s, slip, allowed'),
        ('time_s,a\n', TIMES),
        ('time_s,a\n0,1\n0,1\n', TIMES),
        ('time_s,a\n0,1\n1e-9,1\n', ': has 1e+09 Hz, allowed: 1 to 1e+06 Hz'),
        *(
            (f'time_s,a\n0,1\n{line}\n2,1\n', f": line 3 is '{line}', allowed: 2 decimal")
            for line in ('1,x', '1,2,3', '1', 'nan,1', '1e300,1', '1e-99999999999999999999,1')
        ),
        ('time_s,a\n0,1\n1,1_0\n', ": line 3 is '1,1_0', allowed: 2 decimal numbers, time_s"),
        ('time_s;a\n0;1,5\n', ": line 2 is '0;1,5', allowed: 2 decimal numbers, time_s"),
        (',time_s,a\n0,0,1\n1,1,2\n', f'{COLUMNS}(without name), time_s, a, allowed'),
        ('time_s,a,slip\n0,1,0\n1,1,nan\n', ': slip has nan, allowed: 0 and 1'),
        ('\0', f"{COLUMNS}'\\x00', allowed"),
        ('\udcff\udcfetime_s', ": 'utf-8' codec can't decode byte 0xff"),
    ],
)
def test_csv_that_is_wrong_is_named_with_its_line_or_column(tmp_path, text, said):
    path = save_text(tmp_path / 'a.csv', text)
    assert complaint(path).startswith(said)
    with pytest.raises(ValueError, match='csv'):  # it holds the frames of what was read
        read_recording(path)
    opened = [os.readlink(one) for one in glob.glob('/proc/self/fd/*') if os.path.islink(one)]
    assert str(path) not in opened


@pytest.mark.parametrize(
    'text',
    [
        '\ufefftime_s,a,b,\n0,1,\n1,2,3,\n2,3,4,\n',
        'time_s,a,b\r\n0,1,,\r\n1,2,3,\r\n2,3,4,\r\n,,\r\n \r\n',
        'time_s;a;b\n0;1;nan\n1;2;3\n2;3;4\n',
        'time_s\ta\tb\n0\t1\t \n1\t2\t3\n2\t3\t4\n',
    ],
)
def test_what_loggers_write_is_read_and_an_empty_cell_is_a_bad_sample(tmp_path, text):
    (tmp_path / 'a.csv').write_text(text, newline='', encoding='utf-8')
    recording, rows = read_recording(tmp_path / 'a.csv')
    np.testing.assert_array_equal(rows.volts, [[1, np.nan], [2, 3], [3, 4]])
    assert recording.channel_names == ('a', 'b')
    assert recording.counts.bad_samples == 1
    assert not recording.counts.damage


def test_a_last_line_without_an_end_may_be_cut_off_and_is_left_out(tmp_path):
    text = 'time_s,a\n0,20.5\n1,20.6\n2,20.7\n'
    for end in range(text.index('2,20.7') + 1, len(text)):
        for rest in ('', '\0' * 9):
            path = save_text(tmp_path / 'a.csv', text[:end] + rest)
            recording, rows = read_recording(path)
            assert rows.volts.ravel().tolist() == [20.5, 20.6]
            said = 'a.csv: line 4 has no end, so it may be cut off, and is left out: 2 samples'
            assert recording.counts.damage.startswith(said)


def test_a_csv_keeps_its_nanoseconds(tmp_path):
    text = 'time_s,a\n1700000000.123456789,1\n1700000000.133456788,2\n1700000009.03,3\n'
    _, rows = read_recording(save_text(tmp_path / 'a.csv', text))
    stamps_ns = rows.stamps_ns - 1_700_000_000_000_000_000
    assert stamps_ns.tolist() == [123_456_789, 133_456_788, 9_030_000_000]
