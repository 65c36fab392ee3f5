"""Bags that were cut off, or are none: what can be read is, and one line says the rest."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rosbags', reason='needs rosbags')

from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin

from slip_detector.recordings import ENDINGS, open_recording, write_recording
from support.bags import NAMES, PLUGINS, Bag, gathered, rows

MESSAGES = 4000

ENDING_OF = {StoragePlugin.MCAP: '.mcap', StoragePlugin.SQLITE3: '.db3'}


def write_bag(path, plugin, mode=CompressionMode.NONE, n=MESSAGES):
    written = rows(n, channels=3)
    bag = Bag(path, plugin)
    bag.writer.set_compression(mode, CompressionFormat.ZSTD)
    with bag:
        for k, (stamp_ns, row) in enumerate(zip(written.stamps_ns, written.volts, strict=True)):
            if k == 0 or written.truth[k] != written.truth[k - 1]:
                slip = bag.make('std_msgs/msg/Bool', data=bool(written.truth[k]))
                bag.write('/slip_truth', slip, stamp_ns)
            bag.write('/voltages', bag.joints(stamp_ns, row), stamp_ns)
    (file,) = [file for file in path.iterdir() if file.name != 'metadata.yaml']
    return written, file


def read_of(path):
    """Return what can be read, and the one line on the rest."""
    recording = open_recording(path)
    read = gathered(recording)
    assert '\n' not in recording.counts.lost
    return read, recording.counts.lost


def is_beginning(read, written):
    n = len(read.volts)
    assert read.volts.tobytes() == written.volts[:n].tobytes()
    np.testing.assert_array_equal(read.stamps_ns, written.stamps_ns[:n])
    if read.truth is not None:
        np.testing.assert_array_equal(read.truth, written.truth[:n])


@pytest.mark.parametrize('in_folder', [True, False])
@pytest.mark.parametrize(
    ('plugin', 'mode'),
    [
        (StoragePlugin.MCAP, CompressionMode.NONE),
        (StoragePlugin.MCAP, CompressionMode.STORAGE),
        (StoragePlugin.SQLITE3, CompressionMode.NONE),
    ],
)
def test_wherever_a_bag_is_cut_its_beginning_is_read(tmp_path, plugin, mode, in_folder):
    written, file = write_bag(tmp_path / 'a', plugin, mode)
    content = file.read_bytes()
    path = file.parent if in_folder else file
    if not in_folder:
        path = tmp_path / file.name
    counts = []
    for share in np.linspace(0.0, 1.0, 23)[:-1]:
        cut = path if path.is_file() or not in_folder else file
        cut.write_bytes(content[: int(share * len(content))])
        try:
            read, lost = read_of(path)
        except ValueError as error:
            said = str(error)
            # Not even the definitions are there, or no sample is.
            assert share < 0.2, said
            assert said.startswith(f'{path}: ')
            assert '\n' not in said
            counts.append(0)
            continue
        is_beginning(read, written)
        counts.append(len(read.volts))
        if len(read.volts) < MESSAGES:
            assert file.name in lost
            assert f'/voltages is lost, {len(read.volts)} messages up to' in lost
            if in_folder:
                assert f'{MESSAGES - len(read.volts)} of {MESSAGES} messages' in lost
    assert counts == sorted(counts)
    # Little more is lost than what is not there.
    for share, count in zip(np.linspace(0.0, 1.0, 23)[:-1], counts, strict=True):
        assert count >= (share - 0.25) * MESSAGES
    assert counts[-1] > 0.7 * MESSAGES


@pytest.mark.parametrize('plugin', PLUGINS)
@pytest.mark.parametrize('mode', [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_what_the_recorder_compressed_may_be_cut_too(tmp_path, plugin, mode):
    written, file = write_bag(tmp_path / 'a', plugin, mode)
    content = file.read_bytes()
    file.write_bytes(content[: len(content) * 2 // 3])
    read, lost = read_of(tmp_path / 'a')
    is_beginning(read, written)
    assert MESSAGES * 0.3 < len(read.volts) < MESSAGES
    assert f'{MESSAGES - len(read.volts)} of {MESSAGES} messages on /voltages is lost' in lost


@pytest.mark.parametrize('plugin', PLUGINS)
def test_a_file_that_is_taken_out_of_a_bag_whose_recorder_died_is_read(tmp_path, plugin):
    written, file = write_bag(tmp_path / 'a', plugin, n=200)
    (file.parent / 'metadata.yaml').unlink()
    for path in (file, file.parent):
        read, lost = read_of(path)
        is_beginning(read, written)
        assert len(read.volts) == 200
        assert not lost


@pytest.mark.parametrize('end', [None, -30])
def test_a_damaged_chunk_costs_no_other(tmp_path, end):
    written, file = write_bag(tmp_path / 'a', StoragePlugin.MCAP, CompressionMode.STORAGE, 30000)
    content = bytearray(file.read_bytes())
    pattern = b'zstd.{8}' + re.escape(bytes.fromhex('28b52ffd'))
    frames = [match.start() for match in re.finditer(pattern, content, re.DOTALL)]
    assert len(frames) > 2
    content[frames[1] + 12] ^= 1  # The second chunk is no zstd any more.
    file.write_bytes(content[:end])
    read, lost = read_of(file)
    assert f'{file.name} is damaged at byte ' in lost
    assert 15000 < len(read.volts) < 30000
    assert set(read.stamps_ns.tolist()) <= set(written.stamps_ns.tolist())
    assert read.stamps_ns[-1] == written.stamps_ns[-1]


def test_labels_after_the_loss_are_not_held_against_the_person(tmp_path):
    _, file = write_bag(tmp_path / 'a', StoragePlugin.MCAP)
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    (tmp_path / 'a' / 'a.labels.yaml').write_text('slip_s: [[1.0, 1.5], [9.0, 9.5]]')
    read, lost = read_of(file)
    assert lost
    assert 180 < read.truth.sum() < 200


@pytest.mark.parametrize('ending', ENDINGS)
@given(data=st.data())
def test_no_bytes_end_in_anything_but_rows_or_one_line(tmp_path_factory, ending, data):
    folder = tmp_path_factory.mktemp('fuzz')
    path = folder / f'a{ending}'
    write_recording(path, [rows(40)], 380.0, NAMES)
    content = bytearray(path.read_bytes())
    kind = data.draw(st.sampled_from(['noise', 'cut', 'flipped', 'other ending', 'zeros']))
    if kind == 'noise':
        content = bytearray(data.draw(st.binary(max_size=200)))
    elif kind == 'cut':
        content = content[: data.draw(st.integers(0, len(content)))]
    elif kind == 'flipped':
        for place in data.draw(st.lists(st.integers(0, len(content) - 1), max_size=5)):
            content[place] ^= data.draw(st.integers(1, 255))
    elif kind == 'zeros':
        begin = data.draw(st.integers(0, len(content)))
        content[begin : begin + 100] = bytes(100)
    else:
        path = folder / f'b{data.draw(st.sampled_from(ENDINGS))}'
    path.write_bytes(content)
    try:
        recording = open_recording(path)
        for piece in recording.pieces():
            assert len(piece.volts) == len(piece.stamps_ns) > 0
        assert '\n' not in recording.counts.lost
    except ValueError as error:
        said = str(error)
        assert said.startswith(f'{path}: ')
        assert '\n' not in said


@pytest.mark.parametrize('mode', [CompressionMode.FILE, CompressionMode.MESSAGE])
@pytest.mark.parametrize('plugin', PLUGINS)
def test_no_damage_to_a_folder_ends_in_anything_but_rows_or_one_line(tmp_path, plugin, mode):
    _, file = write_bag(tmp_path / 'a', plugin, mode, n=50)
    metadata = file.parent / 'metadata.yaml'
    random = np.random.default_rng(3)
    outcomes = set()
    for damaged in (file, metadata):
        content = damaged.read_bytes()
        for _ in range(60):
            broken = bytearray(content)
            for place in random.integers(0, len(broken), 4):
                broken[place] = random.integers(0, 256)
            damaged.write_bytes(broken)
            try:
                recording = open_recording(tmp_path / 'a')
                outcomes.add(sum(len(piece.volts) for piece in recording.pieces()))
                assert '\n' not in recording.counts.lost
            except ValueError as error:
                said = str(error)
                assert said.startswith(f'{tmp_path / "a"}: ')
                assert '\n' not in said
        damaged.write_bytes(content)
    assert 50 in outcomes
