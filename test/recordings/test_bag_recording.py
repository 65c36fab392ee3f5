"""Bags: what was written is read, to the bit, whatever the message, the file or the recorder."""

import re
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

pytest.importorskip('rosbags', reason='needs rosbags')

from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import CompressionFormat, CompressionMode

from slip_detector.parameters.recording import RecordingConfig
from slip_detector.recordings import (
    RecordedRows,
    bag_recording,
    open_recording,
    write_recording,
)
from support.bags import (
    ENDINGS,
    JOINT_STATE,
    NAMES,
    PLUGINS,
    START_NS,
    Bag,
    gathered,
    rows,
    stamps,
)
from support.recorded import read_recording


def same(read, written):
    assert read.volts.tobytes() == written.volts.tobytes()
    np.testing.assert_array_equal(read.stamps_ns, written.stamps_ns)
    assert (read.truth is None) == (written.truth is None)
    if written.truth is not None:
        np.testing.assert_array_equal(read.truth, written.truth)


@pytest.mark.parametrize('ending', ['', '.mcap', '.db3'])
def test_a_bag_says_with_which_quality_its_topics_were_offered(tmp_path, ending):
    path = tmp_path / f'trial{ending}'
    write_recording(path, [rows()], 380.0, NAMES)
    with AnyReader([path]) as reader:
        offered = {one.topic: one.ext.offered_qos_profiles for one in reader.connections}
    (sample,), (state,) = offered['/voltages'], offered['/slip_truth']
    assert sample.reliability is QosReliability.BEST_EFFORT
    assert state.reliability is QosReliability.RELIABLE
    assert state.durability is QosDurability.TRANSIENT_LOCAL
    assert state.depth == 1


def complaint(path, **parameters):
    with pytest.raises(ValueError, match=re.escape(str(path))) as caught:
        for _ in open_recording(path, RecordingConfig(**parameters)).pieces():
            pass
    assert '\n' not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize('ending', ENDINGS)
@given(data=st.data())
def test_what_is_written_is_read_back_to_the_bit(tmp_path_factory, ending, data):
    n, channels = data.draw(st.integers(2, 40)), data.draw(st.integers(1, 5))
    finite = st.floats(allow_nan=False, allow_infinity=False, width=64)
    volts = data.draw(hnp.arrays(np.float64, (n, channels), elements=finite))
    truth = data.draw(st.none() | hnp.arrays(np.bool_, n))
    start_ns = data.draw(st.integers(0, 2**60))
    steps_ns = data.draw(st.lists(st.integers(9_000_000, 11_000_000), min_size=n, max_size=n))
    stamps_ns = start_ns + np.cumsum(np.array(steps_ns, dtype=np.int64))
    written = RecordedRows(volts, stamps_ns, truth)
    cut = data.draw(st.integers(0, n))
    pieces = [written.take(slice(cut)), written.take(slice(cut, None))]
    path = tmp_path_factory.mktemp('written') / f'trial{ending}'
    names = [f'taxel_{i}' for i in range(channels)]
    write_recording(path, [piece for piece in pieces if len(piece.volts)], 100.0, names)
    recording = open_recording(path)
    same(gathered(recording), written)
    assert recording.has_truth == (truth is not None)
    assert recording.sample_rate_hz == pytest.approx(100.0, rel=0.12)
    assert list(recording.channel_names) == (
        names if recording.named else [f'ch{i + 1}' for i in range(channels)]
    )
    assert recording.counts.rows == n


@pytest.mark.parametrize('ending', ['.mcap', '.db3', '', '.npz'])
def test_what_is_no_number_is_written_read_and_counted(tmp_path, ending):
    written = rows(50)
    written.volts[7, 1], written.volts[9, 0] = np.nan, -np.inf
    write_recording(tmp_path / f'a{ending}', [written], 380.0, NAMES)
    recording = open_recording(tmp_path / f'a{ending}')
    same(gathered(recording), written)
    assert recording.counts.bad_samples == 2


def test_nothing_is_overwritten_and_no_half_recording_stays(tmp_path):
    path = tmp_path / 'a.mcap'
    write_recording(path, [rows(10)], 380.0, NAMES)
    with pytest.raises(ValueError, match=r'a\.mcap: is there already, allowed: a new path'):
        write_recording(path, [rows(20)], 380.0, NAMES)

    def failing():
        yield rows(10)
        raise ValueError('the source failed')

    for ending in ENDINGS:
        with pytest.raises(ValueError, match='the source failed'):
            write_recording(tmp_path / f'b{ending}', failing(), 380.0, NAMES)
    assert [file.name for file in tmp_path.iterdir()] == ['a.mcap']
    with pytest.raises(
        ValueError, match=r'a\.bag: is \.bag, allowed: \.npz, \.csv, \.mcap, \.db3'
    ):
        write_recording(tmp_path / 'a.bag', [rows(10)], 380.0, NAMES)


@pytest.mark.parametrize('plugin', PLUGINS)
def test_any_message_type_is_read_by_topic_and_field(tmp_path, plugin):
    pillar, state = 'papillarray_msgs/msg/PillarState', 'papillarray_msgs/msg/SensorState'
    definitions = [
        (pillar, 'float32 dx\nfloat32 fz\nbool in_contact\n'),
        (state, f'std_msgs/Header header\nuint8 id\n{pillar}[] pillars\nfloat64 gfx\n'),
    ]
    volts = np.random.default_rng(1).normal(size=(300, 4)).astype(np.float32)
    with Bag(tmp_path / 'a', plugin, definitions) as bag:
        for stamp_ns, row in zip(stamps(300), volts, strict=True):
            pillars = [bag.make(pillar, dx=0.0, fz=fz, in_contact=True) for fz in row]
            message = bag.make(state, header=bag.header(stamp_ns), id=3, pillars=pillars, gfx=1.5)
            bag.write('/hub/sensor_0', message, stamp_ns + 12345)
    path = tmp_path / 'a'
    config = RecordingConfig(recording_topic='/hub/sensor_0', recording_field='pillars[].fz')
    recording = open_recording(path, config)
    same(gathered(recording), RecordedRows(volts.astype(np.float64), stamps(300), None))
    assert recording.channel_names == ('ch1', 'ch2', 'ch3', 'ch4')
    one = RecordingConfig(recording_topic='sensor_0', recording_field='pillars[2].fz')
    np.testing.assert_array_equal(read_recording(path, one).volts, volts[:, 2:3])
    assert 'has no voltages' not in complaint(path)
    assert f'has no topic voltages, there are: /hub/sensor_0 ({state})' in complaint(path)
    assert 'there are: header, id, pillars, gfx' in complaint(path, recording_topic='sensor_0')
    said = complaint(path, recording_topic='sensor_0', recording_field='pillars[].fx')
    assert 'field pillars[].fx: pillars[0] has no fx, there are: dx, fz, in_contact' in said
    said = complaint(path, recording_topic='sensor_0', recording_field='pillars[4].fz')
    assert 'pillars has 4 elements' in said


def test_a_type_that_is_defined_in_idl_is_read(tmp_path):
    text = 'module syntouch { module msg { struct BioTac { double pac[3]; int32 pdc; }; }; };'
    with Bag(tmp_path / 'a', definitions=[('', text)]) as bag:
        for k, stamp_ns in enumerate(stamps(20)):
            message = bag.make('syntouch/msg/BioTac', pac=np.arange(3.0) + k, pdc=k)
            bag.write('/biotac', message, stamp_ns)
    config = RecordingConfig(recording_topic='/biotac', recording_field='pac')
    volts = np.arange(20.0)[:, np.newaxis] + np.arange(3.0)
    # Without a header the time of receipt is the stamp.
    same(gathered(open_recording(tmp_path / 'a', config)), RecordedRows(volts, stamps(20), None))


def test_messages_of_other_layouts_are_read_one_by_one_to_the_same_bits(tmp_path):
    written = rows(400)
    with Bag(tmp_path / 'a') as bag:
        for k, (stamp_ns, row) in enumerate(zip(written.stamps_ns, written.volts, strict=True)):
            bag.write(
                '/voltages',
                bag.joints(stamp_ns, row, frame_id=f'tip{"x" * (k % 70)}{k}'),
                stamp_ns,
            )
    same(gathered(open_recording(tmp_path / 'a')), written._replace(truth=None))


def test_messages_with_other_channels_or_names_are_left_out_and_counted(tmp_path):
    written = rows(60)
    with Bag(tmp_path / 'a') as bag:
        for k, (stamp_ns, row) in enumerate(zip(written.stamps_ns, written.volts, strict=True)):
            bag.write('/voltages', bag.joints(stamp_ns, row), stamp_ns)
            other = [('left', 'right'), ('left', 'tip', 'right')][k % 2]
            bag.write(
                '/voltages', bag.joints(stamp_ns + 1, row[: len(other)], other), stamp_ns + 1
            )
    recording = open_recording(tmp_path / 'a')
    same(gathered(recording), written._replace(truth=None))
    assert recording.counts.dropped == 60
    assert recording.channel_names == NAMES


@pytest.mark.parametrize('samples', [1, 4, 25])
def test_batches_are_spread_over_their_time(tmp_path, samples):
    n = 500
    volts = rows(n, channels=2).volts.astype(np.float32)
    with Bag(tmp_path / 'a') as bag:

        def dimension(label, size, stride):
            return bag.make(
                'std_msgs/msg/MultiArrayDimension', label=label, size=size, stride=stride
            )

        sizes = [dimension('sample', samples, 2 * samples), dimension('channel', 2, 2)]
        layout = bag.make('std_msgs/msg/MultiArrayLayout', dim=sizes, data_offset=0)
        for first in range(0, n, samples):
            data = volts[first : first + samples].reshape(-1)
            message = bag.make('std_msgs/msg/Float32MultiArray', layout=layout, data=data)
            bag.write('/voltages', message, stamps(n)[first + samples - 1])
    recording = open_recording(tmp_path / 'a')
    read = gathered(recording)
    np.testing.assert_array_equal(read.volts, volts)
    assert np.abs(read.stamps_ns - stamps(n)).max() < 10
    assert recording.sample_rate_hz == pytest.approx(380.0)
    assert recording.counts.gaps == recording.counts.dropped == 0


@pytest.mark.parametrize('mode', [CompressionMode.FILE, CompressionMode.MESSAGE])
@pytest.mark.parametrize('plugin', PLUGINS)
def test_bags_that_the_recorder_compressed_are_read(tmp_path, plugin, mode):
    written = rows(200, truth=False)
    bag = Bag(tmp_path / 'a', plugin)
    bag.writer.set_compression(mode, CompressionFormat.ZSTD)
    with bag:
        for stamp_ns, row in zip(written.stamps_ns, written.volts, strict=True):
            bag.write('/voltages', bag.joints(stamp_ns, row), stamp_ns)
    same(gathered(open_recording(tmp_path / 'a')), written)


def test_a_compressed_mcap_is_read(tmp_path):
    written = rows(200, truth=False)
    bag = Bag(tmp_path / 'a')
    bag.writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with bag:
        for stamp_ns, row in zip(written.stamps_ns, written.volts, strict=True):
            bag.write('/voltages', bag.joints(stamp_ns, row), stamp_ns)
    same(gathered(open_recording(tmp_path / 'a')), written)


@pytest.mark.parametrize('ending', ['.mcap', '.db3'])
def test_a_bag_that_was_split_into_files_is_one_recording(tmp_path, ending):
    written = rows(900)
    folder = tmp_path / 'split'
    folder.mkdir()
    files = []
    for k in range(3):
        part = written.take(slice(300 * k, 300 * (k + 1)))
        # More than nine files: their numbers count, not their letters.
        files.append(f'split_{k + 8}{ending}')
        write_recording(folder / files[-1], [part], 380.0, NAMES)
    topics = '\n'.join(
        f'    - message_count: {count}\n      topic_metadata: {{name: {name}, type: {msgtype}, '
        'serialization_format: cdr, offered_qos_profiles: ""}'
        for name, msgtype, count in (
            ('/voltages', JOINT_STATE, 900),
            ('/slip_truth', 'std_msgs/msg/Bool', 11),
        )
    )
    (folder / 'metadata.yaml').write_text(f"""rosbag2_bagfile_information:
  version: 5
  storage_identifier: {'mcap' if ending == '.mcap' else 'sqlite3'}
  relative_file_paths: [{', '.join(files)}]
  duration: {{nanoseconds: 2000000000}}
  starting_time: {{nanoseconds_since_epoch: {START_NS}}}
  message_count: 911
  compression_format: ""
  compression_mode: ""
  topics_with_message_count:
{topics}
""")
    same(gathered(open_recording(folder)), written)


def test_the_truth_is_taken_from_the_namespace_of_the_rows(tmp_path):
    written = rows(300)
    with Bag(tmp_path / 'a') as bag:
        for k, (stamp_ns, row) in enumerate(zip(written.stamps_ns, written.volts, strict=True)):
            for finger, slip in (('left', written.truth[k]), ('right', not written.truth[k])):
                if k == 0 or written.truth[k] != written.truth[k - 1]:
                    message = bag.make('std_msgs/msg/Bool', data=bool(slip))
                    bag.write(f'/{finger}/slip_truth', message, stamp_ns)
                bag.write(f'/{finger}/voltages', bag.joints(stamp_ns, row), stamp_ns)
    left = RecordingConfig(recording_topic='/left/voltages')
    right = RecordingConfig(recording_topic='/right/voltages')
    same(gathered(open_recording(tmp_path / 'a', left)), written)
    same(gathered(open_recording(tmp_path / 'a', right)), written._replace(truth=~written.truth))
    said = complaint(tmp_path / 'a')
    assert 'has /left/voltages, /right/voltages, allowed: one of them, named by --topic' in said


def test_a_truth_that_was_received_late_holds_from_its_receipt_on(tmp_path):
    n = 50
    with Bag(tmp_path / 'a') as bag:
        for k, stamp_ns in enumerate(stamps(n)):
            # All arrives 3 ms after its stamp; slip begins with row 20, before it was any.
            if k in (20, 30):
                bag.write(
                    '/slip_truth',
                    bag.make('std_msgs/msg/Bool', data=k == 20),
                    stamp_ns + 2_999_000,
                )
            bag.write('/voltages', bag.joints(stamp_ns, [0.0] * 3), stamp_ns + 3_000_000)
    truth = gathered(open_recording(tmp_path / 'a')).truth
    np.testing.assert_array_equal(truth, (np.arange(n) >= 20) & (np.arange(n) < 30))


def test_a_position_that_changes_is_slip(tmp_path):
    n = 400
    position_m = np.interp(np.arange(n), [99, 199, 250, 300], [0.0, 5e-3, 5e-3, 2e-3])
    written = rows(n, truth=False)
    write_recording(tmp_path / 'a.mcap', [written._replace(position_m=position_m)], 380.0, NAMES)
    truth = gathered(open_recording(tmp_path / 'a.mcap')).truth
    k = np.arange(n)
    # From the last row at which it still stood to the first at which it stands again (Eq. 9).
    np.testing.assert_array_equal(truth, ((k >= 99) & (k <= 199)) | ((k >= 250) & (k <= 300)))
    noisy = position_m + 1e-6 * np.random.default_rng(0).uniform(-1, 1, n)
    write_recording(tmp_path / 'b.mcap', [written._replace(position_m=noisy)], 380.0, NAMES)
    still = RecordingConfig(recording_still_m=5e-6)
    np.testing.assert_array_equal(
        gathered(open_recording(tmp_path / 'b.mcap', still)).truth, truth
    )
    assert gathered(open_recording(tmp_path / 'b.mcap')).truth.all()


def test_a_truth_goes_before_a_position_and_the_npz_keeps_both(tmp_path):
    written = rows(300)._replace(position_m=np.arange(300.0))
    for ending in ('.mcap', '.npz'):
        write_recording(tmp_path / f'a{ending}', [written], 380.0, NAMES)
        same(gathered(open_recording(tmp_path / f'a{ending}')), written)
    np.testing.assert_array_equal(
        open_recording(tmp_path / 'a.npz').array('position_m'), written.position_m
    )


def test_a_topic_of_labels_that_is_named_must_be_there(tmp_path):
    write_recording(tmp_path / 'a.mcap', [rows(50)], 380.0, NAMES)
    said = complaint(tmp_path / 'a.mcap', recording_truth_topic='sliding')
    assert "parameter recording_truth_topic is 'sliding'" in said
    assert 'there are: /slip_truth' in said


def test_a_bag_without_samples_or_with_a_stopped_clock_says_so(tmp_path):
    with Bag(tmp_path / 'empty') as bag:
        bag.write('/chatter', bag.make('std_msgs/msg/String', data='hello'), START_NS)
    said = complaint(tmp_path / 'empty')
    assert 'has no topic voltages, there are: /chatter (std_msgs/msg/String)' in said
    with Bag(tmp_path / 'stopped') as bag:
        for _ in range(10):
            bag.write('/voltages', bag.joints(0, [1.0, 2.0, 3.0]), START_NS)
    assert 'the stamps on /voltages do not rise' in complaint(tmp_path / 'stopped')
    with Bag(tmp_path / 'hollow') as bag:
        for stamp_ns in stamps(10):
            bag.write('/voltages', bag.joints(stamp_ns, [], ()), stamp_ns)
    assert 'the field position is empty in every message' in complaint(tmp_path / 'hollow')
    (tmp_path / 'nothing').mkdir()
    assert 'has no files of a bag, allowed: .mcap or .db3' in complaint(tmp_path / 'nothing')
    assert 'cannot be read (No such file' in complaint(tmp_path / 'no.mcap')


@pytest.mark.parametrize('ending', ['.mcap', '.db3', '.npz', '.csv'])
def test_memory_does_not_grow_with_the_length(tmp_path, ending):
    def peak(n):
        path = tmp_path / f'{n}{ending}'
        whole = rows(n, channels=4)
        write_recording(path, [whole], 380.0, 'abcd')
        del whole
        tracemalloc.start()
        count = sum(len(piece.volts) for piece in open_recording(path).pieces())
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert count == n
        return most

    peak(100)  # What is loaded and kept once.
    short, long = peak(30_000), peak(120_000)
    assert long < 1.2 * short


def test_without_rosbags_npz_is_read_and_a_bag_says_what_to_install(tmp_path):
    for ending in ('.mcap', '.npz'):
        write_recording(tmp_path / f'a{ending}', [rows(20)], 380.0, NAMES)
    code = (
        'import sys; sys.modules["rosbags"] = None\n'
        'from slip_detector.recordings import open_recording\n'
        'print(sum(len(piece.volts) for piece in open_recording(sys.argv[1] + ".npz").pieces()))\n'
        'try:\n    open_recording(sys.argv[1] + ".mcap")\n'
        'except ValueError as error:\n    print(error)\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', code, str(tmp_path / 'a')],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    said = f'{tmp_path / "a.mcap"}: bags need the package rosbags: pip install rosbags'
    assert done.stdout.splitlines() == ['20', said]


def test_the_first_messages_do_not_decide_what_the_later_ones_are(tmp_path, monkeypatch):
    monkeypatch.setattr(bag_recording, 'FIRST_MESSAGES', 3)
    monkeypatch.setattr(bag_recording, 'PIECE_ROWS', 7)
    written = rows(100)
    write_recording(tmp_path / 'a.mcap', [written], 380.0, NAMES)
    same(gathered(open_recording(tmp_path / 'a.mcap')), written)
