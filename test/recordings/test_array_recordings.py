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

"""Recordings in csv and npz: what comes in comes out, and what is wrong is said in one line."""

import glob
import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from support.recorded import VOLTS, complaint, read_recording, save_npz, save_text

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


LOGGED = [
    '\ufefftime_s,a,b,\n0,1,\n1,2,3,\n2,3,4,\n',
    'time_s,a,b\r\n0,1,,\r\n1,2,3,\r\n2,3,4,\r\n,,\r\n \r\n',
    'time_s;a;b\n0;1;nan\n1;2;3\n2;3;4\n',
    'time_s\ta\tb\n0\t1\t \n1\t2\t3\n2\t3\t4\n',
]


@pytest.mark.parametrize('text', LOGGED)
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


@given(
    hnp.arrays(
        st.sampled_from([np.float32, np.float64, np.uint16, np.int32]),
        hnp.array_shapes(min_dims=2, max_dims=2, max_side=6),
    ),
    st.floats(1.0, 1e6),
)
def test_npz_of_any_number_type_keeps_every_value(tmp_path_factory, volts, rate_hz):
    path = tmp_path_factory.mktemp('npz') / 'a.npz'
    save_npz(path, volts=volts, sample_rate_hz=rate_hz, slip=None)
    recording, rows = read_recording(path)
    assert rows.volts.dtype == np.float64
    np.testing.assert_array_equal(rows.volts, volts)
    assert recording.sample_rate_hz == rate_hz
    assert rows.truth is None


WHOLE = ', allowed: whole nanoseconds'
OTHER_HZ = ': stamps_ns has 125 Hz, sample_rate_hz 380 Hz, allowed: '


@pytest.mark.parametrize(
    ('arrays', 'said'),
    [
        ({'volts': None}, ': has no array volts, there are: sample_rate_hz, slip'),
        ({'sample_rate_hz': None}, ': has no array sample_rate_hz, there are: slip, volts'),
        ({'volts': [1.0, 2.0]}, ': volts has the shape (2,) and type float64, allowed: numbers'),
        ({'volts': [['a']]}, ': volts has the shape (1, 1) and type <U1, allowed: numbers'),
        ({'volts': np.empty((0, 2))}, ': volts has the shape (0, 2) and type'),
        ({'sample_rate_hz': np.nan}, ': has nan Hz, allowed: 1 to 1e+06 Hz'),
        ({'sample_rate_hz': [60, 60]}, ': sample_rate_hz is [60 60], allowed: a rate in Hz'),
        ({'slip': [0, 1]}, ': slip has the shape (2,), allowed: (3,)'),
        ({'slip': [0, np.nan, 1]}, ': slip has nan, allowed: 0 and 1'),
        ({'slip': ['False'] * 3}, ": slip has 'False', allowed: 0 and 1"),
        ({'stamps_ns': [0.0, 0.5, 1.0]}, f': stamps_ns has 0.5{WHOLE}'),
        ({'stamps_ns': np.array([0, 1, 2**63], np.uint64)}, f': stamps_ns has {2**63}{WHOLE}'),
        ({'stamps_ns': [False, True, True]}, f': stamps_ns has the type bool{WHOLE}'),
        ({'stamps_ns': [5, 5, 4]}, ': stamps_ns do not rise, allowed: two or more rows'),
        ({'stamps_ns': [0, 8e6, 16e6]}, OTHER_HZ),
        ({'sample_rate_hz': 380j}, ': sample_rate_hz is 380j, allowed: a rate in Hz'),
        ({'volts': [[None]]}, ': Object arrays cannot be loaded when allow_pickle=False'),
    ],
)
def test_npz_that_lacks_something_is_named_with_what_it_lacks(tmp_path, arrays, said):
    assert complaint(save_npz(tmp_path / 'a.npz', **arrays)).startswith(said)


def test_a_file_that_is_cut_off_or_no_npz_is_named(tmp_path):
    content = save_npz(tmp_path / 'a.npz').read_bytes()
    for wrong in (b'time_s,a\n0,1\n', content[:-9], b''):
        (tmp_path / 'a.npz').write_bytes(wrong)
        said = ': is cut off, or no npz, allowed: what numpy.savez writes'
        assert complaint(tmp_path / 'a.npz') == said


def test_a_file_gives_rows_names_and_truth_and_all_its_arrays_by_name(tmp_path):
    path = save_npz(tmp_path / 'a.npz', velocity=np.arange(5), names=['a', 'b'])
    recording, rows = read_recording(path)
    np.testing.assert_array_equal(rows.volts, VOLTS)
    assert (rows.truth.tolist(), recording.channel_names) == ([False, True, True], ('ch1', 'ch2'))
    np.testing.assert_array_equal(recording.array('velocity'), np.arange(5))
    assert recording.array('names').tolist() == ['a', 'b']
    assert recording.array('nothing') is None
    assert recording.array_names() == ['names', 'sample_rate_hz', 'slip', 'velocity', 'volts']
