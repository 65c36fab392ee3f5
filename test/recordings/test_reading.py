"""Reading of recordings: what comes in comes out, and what is wrong is said in one line."""

import io
import re
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from slip_detector.parameters.recording import RecordingConfig
from support.recorded import read_recording

VOLTS = np.array([[4.3, 4.31], [4.25, 4.3], [4.2, 4.29]])

FLOATS = st.floats(allow_nan=False, allow_infinity=False, width=64)


def npz(path, **arrays):
    parts = {'volts': VOLTS, 'sample_rate_hz': 380.0, 'slip': [0, 1, 1], **arrays}
    np.savez(path, **{name: value for name, value in parts.items() if value is not None})
    return path


def csv(path, text):
    path.write_text(text, encoding='utf-8')
    return path


def complaint(path, config=None):
    with pytest.raises(ValueError, match=re.escape(str(path))) as caught:
        read_recording(path, config)
    assert '\n' not in str(caught.value)
    return str(caught.value).removeprefix(str(path))


def test_npz_gives_rows_rate_label_and_all_arrays(tmp_path):
    recording = read_recording(npz(tmp_path / 'a.npz', marker=[7, 8, 9]))
    np.testing.assert_array_equal(recording.volts, VOLTS)
    assert recording.sample_rate_hz == 380.0
    assert recording.channel_names == ('ch1', 'ch2')
    np.testing.assert_array_equal(recording.truth, [False, True, True])
    np.testing.assert_array_equal(recording.arrays['marker'], [7, 8, 9])


@given(
    hnp.arrays(
        st.sampled_from([np.float32, np.float64, np.uint16, np.int32]),
        hnp.array_shapes(min_dims=2, max_dims=2, max_side=6),
    ),
    st.floats(1.0, 1e6),
)
def test_npz_of_any_number_type_keeps_every_value(tmp_path_factory, volts, rate_hz):
    path = tmp_path_factory.mktemp('npz') / 'a.npz'
    recording = read_recording(npz(path, volts=volts, sample_rate_hz=rate_hz, slip=None))
    assert recording.volts.dtype == np.float64
    np.testing.assert_array_equal(recording.volts, volts)
    assert recording.sample_rate_hz == rate_hz
    assert recording.truth is None


@given(
    hnp.arrays(np.float64, st.tuples(st.integers(2, 8), st.integers(1, 4)), elements=FLOATS),
    st.floats(1.0, 1e4),
    st.data(),
)
def test_csv_keeps_every_value_and_tells_the_rate(tmp_path_factory, volts, rate_hz, data):
    n, c = volts.shape
    slip = data.draw(st.lists(st.booleans(), min_size=n, max_size=n))
    names = [f'taxel_{i}' for i in range(c)]
    # The label may stand anywhere: a column is known by its name.
    place = data.draw(st.integers(0, c))
    head = ['time_s', *names[:place], 'slip', *names[place:]]
    lines = [','.join(head)]
    for k in range(n):
        cells = [repr(float(v)) for v in volts[k]]
        cells.insert(place, str(int(slip[k])))
        lines.append(','.join([repr(k / rate_hz), *cells]))
    path = csv(tmp_path_factory.mktemp('csv') / 'a.csv', '\n'.join(lines) + '\n')
    recording = read_recording(path)
    assert recording.volts.tobytes() == volts.tobytes()
    assert recording.channel_names == tuple(names)
    assert recording.sample_rate_hz == pytest.approx(rate_hz, rel=1e-12)
    np.testing.assert_array_equal(recording.truth, slip)


def test_keys_are_taken_from_the_configuration(tmp_path):
    path = tmp_path / 'a.npz'
    np.savez(path, tactile=VOLTS, fs=60.0, label=[1, 0, 0], slip=[0, 0, 1])
    keys = RecordingConfig(
        recording_volts_key='tactile', recording_rate_key='fs', recording_truth_key='label'
    )
    recording = read_recording(path, keys)
    assert recording.sample_rate_hz == 60.0
    np.testing.assert_array_equal(recording.truth, [True, False, False])


def test_csv_without_label_has_no_truth(tmp_path):
    assert read_recording(csv(tmp_path / 'a.csv', 'time_s,a\n0,1\n1,2\n')).truth is None


def test_bad_samples_are_kept_for_the_chain_to_judge(tmp_path):
    volts = np.array([[1.0, np.nan], [np.inf, 2.0]])
    in_npz = read_recording(npz(tmp_path / 'a.npz', volts=volts, slip=None))
    in_csv = read_recording(csv(tmp_path / 'a.csv', 'time_s,a,b\n0,1,nan\n1,inf,2\n'))
    np.testing.assert_array_equal(in_npz.volts, volts)
    np.testing.assert_array_equal(in_csv.volts, volts)


def test_the_rate_of_a_csv_is_that_of_the_whole_and_jitter_is_borne(tmp_path):
    times = np.cumsum([0.0] + [0.009, 0.009, 0.012] * 40)  # Most steps are short.
    lines = [f'{t:.6f},1' for t in times]
    recording = read_recording(csv(tmp_path / 'a.csv', '\n'.join(['time_s,a', *lines])))
    assert recording.sample_rate_hz == pytest.approx(100.0)


def test_the_mark_that_spreadsheets_write_is_no_part_of_a_name(tmp_path):
    path = csv(tmp_path / 'a.csv', '\ufefftime_s,a\n0,1\n1,2\n')
    assert read_recording(path).channel_names == ('a',)


def test_a_rate_in_an_array_of_one_is_a_rate(tmp_path):
    path = npz(tmp_path / 'a.npz', sample_rate_hz=np.array([60.0]))
    assert read_recording(path).sample_rate_hz == 60.0


@pytest.mark.parametrize(
    ('arrays', 'said'),
    [
        ({'volts': None}, ': has no array volts, there are: sample_rate_hz, slip'),
        ({'sample_rate_hz': None}, ': has no array sample_rate_hz, there are: slip, volts'),
        ({'volts': [1.0, 2.0]}, ': volts has the shape (2,) and type float64, allowed: numbers'),
        ({'volts': [['a']]}, ': volts has the shape (1, 1) and type <U1, allowed: numbers'),
        ({'volts': np.empty((0, 2))}, ': has no samples'),
        ({'volts': np.empty((3, 0))}, ': has no samples'),
        ({'sample_rate_hz': 0.0}, ': sample_rate_hz is 0.0, allowed: a rate in Hz'),
        ({'sample_rate_hz': np.inf}, ': sample_rate_hz is inf, allowed: a rate in Hz'),
        ({'sample_rate_hz': np.nan}, ': sample_rate_hz is nan, allowed: a rate in Hz'),
        ({'sample_rate_hz': [60, 60]}, ': sample_rate_hz is [60 60], allowed: a rate in Hz'),
        ({'slip': [0, 1]}, ': slip has 2 rows, allowed: 3, as volts'),
        ({'slip': [0, np.nan, 1]}, ': slip has nan, allowed: 0 and 1'),
        ({'slip': [0, 2, 1]}, ': slip has 2, allowed: 0 and 1'),
        ({'slip': ['False'] * 3}, ": slip has 'False', allowed: 0 and 1"),
        ({'volts': np.array([[None]])}, ': is broken or not npz (Object arrays'),
    ],
)
def test_npz_that_lacks_something_is_named_with_what_it_lacks(tmp_path, arrays, said):
    assert complaint(npz(tmp_path / 'a.npz', **arrays)).startswith(said)


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('', ': line 1 has no column time_s'),
        ('t,a\n0,1\n', ': line 1 has no column time_s, there are: t, a'),
        ('time_s,a\n0,1\n1,x\n', ": line 3: could not convert string to float: 'x'"),
        ('time_s,a\n0,1\n1,\n', ': line 3: could not convert string to float'),
        ('time_s,a\n0,1\n1,2,3\n', ': line 3 has 3 columns, allowed: 2'),
        ('time_s,a,a\n0,1,1\n1,2,2\n', ': line 1 has a name twice'),
        (
            'time_s,a\n',
            ': column time_s does not rise, allowed: two or more rows, each with its time',
        ),
        ('time_s,a\n0,1\n', ': column time_s does not rise'),
        ('time_s,a\n1,1\n0,1\n', ': column time_s does not rise'),
        ('time_s,a\n0,1\n0,1\n', ': column time_s does not rise'),
        ('time_s,a\n0,1\nnan,1\n2,1\n', ': line 3: time_s is nan, allowed: below 9e+09 s'),
        ('time_s,a\ninf,1\ninf,1\n', ': line 2: time_s is inf, allowed: below'),
        ('time_s,a\n0,1\n1e300,1\n', ': line 3: time_s is 1e300, allowed: below'),
        ('time_s\n0\n1\n', ': has no samples'),
        ('time_s,slip\n0,1\n1,1\n', ': has no samples'),
        ('time_s,a,slip\n0,1,0\n1,1,nan\n', ': slip has nan, allowed: 0 and 1'),
    ],
)
def test_csv_that_is_wrong_is_named_with_its_line_or_column(tmp_path, text, said):
    assert complaint(csv(tmp_path / 'a.csv', text)).startswith(said)


def test_binary_in_a_csv_is_said_to_be_broken(tmp_path):
    path = tmp_path / 'a.csv'
    path.write_bytes(b'\xff\xfe\x00time_s')
    assert complaint(path) == ': is broken or not csv'


def test_a_missing_file_a_folder_and_an_unknown_ending_are_named(tmp_path):
    folder = tmp_path / 'folder.npz'
    folder.mkdir()
    assert complaint(tmp_path / 'no.npz') == ': cannot be read (No such file or directory)'
    assert complaint(folder) == ': cannot be read (Is a directory)'
    allowed = 'allowed: .npz, .csv, .mcap, .db3 or the folder of a bag'
    assert complaint(tmp_path / 'a.bag') == f': is .bag, {allowed}'
    assert complaint(tmp_path / 'bag') == f': is without ending, {allowed}'


def test_files_that_only_look_like_npz_are_refused(tmp_path):
    single = tmp_path / 'single.npz'
    with open(single, 'wb') as file:
        np.save(file, VOLTS)
    assert complaint(single) == ': is broken or not npz'
    foreign = tmp_path / 'foreign.npz'
    with zipfile.ZipFile(foreign, 'w') as archive:
        archive.writestr('volts.npy', b'hello')
        archive.writestr('sample_rate_hz.npy', b'60')
    assert complaint(foreign) == ': is broken or not npz (volts is no array)'
    empty = tmp_path / 'empty.npz'
    empty.touch()
    assert complaint(empty) == ': is broken or not npz'


@pytest.mark.parametrize('save', [np.savez, np.savez_compressed])
def test_an_npz_that_is_damaged_anywhere_is_refused_or_read_but_never_crashes(tmp_path, save):
    buffer = io.BytesIO()
    volts = np.random.default_rng(0).normal(size=(6, 2))
    save(buffer, volts=volts, sample_rate_hz=60.0)
    content = buffer.getvalue()
    damaged = [content[:n] for n in range(0, len(content), 7)]
    for i in range(len(content)):
        damaged.append(content[:i] + bytes([content[i] ^ (1 + 37 * i % 255)]) + content[i + 1 :])
    path = tmp_path / 'a.npz'
    judged = 0
    for broken in damaged:
        path.write_bytes(broken)
        try:
            read = read_recording(path).volts
        except ValueError as error:
            judged += str(error).startswith(f'{path}: ') and '\n' not in str(error)
        else:
            # The checksums of npz guard the content: what is read is what was written.
            np.testing.assert_array_equal(read, volts)
            judged += 1
    assert judged == len(damaged)
