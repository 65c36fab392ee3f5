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

"""The recordings of a finger: how they grow, which there are, and which are held out."""

import asyncio
import json

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.parameters import DetectorConfig
from slip_detector.recordings import open_recording, write_recording
from slip_detector.recordings.labels import BY_HAND_S
from slip_detector.view.detectors import Finger
from slip_detector.view.recordings import (
    KINDS,
    NO_SLIP,
    RecordedFolder,
    Recorder,
    RecordingSummary,
    trace_of,
)


def written(folder, name, slips=0):
    """Write a recording of a second with some slips."""
    truth = np.arange(100) % 20 >= 10 if slips else np.zeros(100, bool)
    truth[20 * slips :] = False
    rows = Samples(np.zeros((100, 2)), np.arange(100) * 10_000_000, truth)
    write_recording(folder / name, [rows], 100.0, ['a', 'b'])


def held_out(recorded):
    return [each['name'] for each in recorded.describe()['recordings'] if each['held_out']]


@pytest.fixture
def recorded(tmp_path):
    return RecordedFolder(tmp_path)


def test_recordings_and_nothing_else_are_listed_in_the_order_in_which_they_were_made(recorded):
    for name in ('slip_10', 'taps_1', 'slip_9', 'rest_1'):
        written(recorded.folder, name, slips=3 * name.startswith('slip'))
    for name in ('rest_0', 'tuning', 'rest_02', 'noise_1', 'rest_2'):
        (recorded.folder / name).mkdir()
    asyncio.run(recorded.refresh())
    assert [*recorded.recordings] == ['rest_1', 'slip_9', 'slip_10', 'taps_1']
    assert recorded.recordings['slip_9'][:3] == ('slip_9', pytest.approx(1.0), 3)
    (recorded.folder / 'rest_1').rename(recorded.folder / 'elsewhere')
    asyncio.run(recorded.refresh())
    assert 'rest_1' not in recorded.recordings
    # A new one has a number that none had.
    new = [recorded.new_path(kind).name for kind in KINDS]
    assert new == ['rest_3', 'slip_11', 'taps_2', 'press_1']


def test_a_recording_that_is_broken_or_has_no_slip_is_listed_with_why_and_not_tuned_on(recorded):
    written(recorded.folder, 'slip_1', slips=1)
    (recorded.folder / 'slip_1' / 'slip_1.mcap').write_bytes(b'no bag')
    written(recorded.folder, 'slip_2')
    written(recorded.folder, 'slip_3', slips=1)
    (recorded.folder / 'slip_3.labels.yaml').write_text('slip_s: [[0.5, 9.0]]')
    written(recorded.folder, 'rest_1')
    asyncio.run(recorded.refresh())
    notes = {name: one.note for name, one in recorded.recordings.items()}
    assert 'slip_1' in notes.pop('slip_1')
    assert 'outside' in notes.pop('slip_3')
    assert notes == {'rest_1': '', 'slip_2': NO_SLIP}
    assert held_out(recorded) == []
    (recorded.folder / 'slip_3.labels.yaml').unlink()
    asyncio.run(recorded.refresh())
    assert recorded.recordings['slip_3'].usable


def test_labels_that_a_person_wrote_are_counted_and_deleted_with_their_recording(recorded):
    written(recorded.folder, 'slip_1', slips=1)
    labels = recorded.folder / 'slip_1.labels.yaml'
    labels.write_text('slip_s: [[0.1, 0.2], [0.3, 0.4]]')
    asyncio.run(recorded.refresh())
    assert recorded.recordings['slip_1'].slips == 2
    recorded.delete('slip_1')
    assert [*recorded.folder.iterdir()] == []
    recorded.add(RecordingSummary('rest_1', 1.0, 0))  # Somebody else has removed it.
    with pytest.raises(ValueError, match=r'rest_1: cannot be deleted \(No such file'):
        recorded.delete('rest_1')


def test_every_third_of_each_kind_is_held_out_from_the_second_on():
    recorded = RecordedFolder(None)
    for name in ('rest_1', 'rest_2', *(f'slip_{k}' for k in range(1, 8)), 'taps_1'):
        recorded.add(RecordingSummary(name, 1.0, int(name.startswith('slip')), rate_hz=380.0))
    assert held_out(recorded) == ['rest_2', 'slip_2', 'slip_5']


def test_a_trace_has_the_signal_in_db_where_the_filters_have_settled_and_a_channel_is_valid():
    config = DetectorConfig(channels=3, groups={'all': (1, 2, 3)}, exponent=1)
    after_ns = np.arange(3800) * 10**9 // 380
    after_ns[1900:] += 5 * 10**9  # A gap.
    volts = np.outer(np.sin(2 * np.pi * 25.0 * after_ns * 1e-9), [0.01, 0.1, 1.0])
    volts[3040:3420] = np.nan
    rows = Samples(volts, after_ns, np.zeros(3800, bool))
    after_gap = rows.take(slice(1900, None))._replace(new_stretch=True)
    trace = trace_of(config, [rows.take(slice(1900)), after_gap], 380.0)
    json.dumps(trace, allow_nan=False)

    def of(curve, from_s, to_s):
        return trace[curve][int(from_s / trace['bin_s']) + 1 : int(to_s / trace['bin_s'])]

    assert trace['duration_s'] == pytest.approx(15.0, abs=0.01)
    for from_s, to_s in ((0.6, 5.0), (10.6, 13.0)):
        np.testing.assert_allclose(of('loudest', from_s, to_s), -3.0, atol=0.5)
        np.testing.assert_allclose(of('median', from_s, to_s), -23.0, atol=0.5)
    for from_s, to_s in ((0.0, 0.3), (5.0, 10.3), (13.1, 14.0)):
        assert set(of('loudest', from_s, to_s) + of('median', from_s, to_s)) == {None}
    still = trace_of(config, [Samples.evenly(np.ones((760, 3)), 380.0, np.zeros(760))], 380.0)
    assert (still['rest_db'], set(still['median'])) == (None, {None})


CONFIG = DetectorConfig(channels=2, groups={'all': (1, 2)}, sample_rate_hz=380.0)


def receive(finger, n):
    """Let samples come, each of which has its number as its value."""
    track = finger.track
    number = track.samples.appended + np.arange(n)
    track.add_samples(Samples(np.stack([number, -number], axis=1), number * 10_000_000))


def test_each_row_from_the_first_on_is_written_once_with_its_label(tmp_path):
    finger = Finger('/index/slip_detector', CONFIG)
    receive(finger, 20)
    recorder, truth, slipping = Recorder(tmp_path / 'slip_1', finger, 15), [False] * 5, False
    for n, slips in ((7, True), (3, True), (9, False), (0, True), (0, False), (4, False)):
        receive(finger, n)
        truth += [slipping] * n
        recorder.label(slips)
        slipping = slips
    assert recorder.has_slip
    cut_off = 'was not ended: slip_1.mcap is cut off '
    for end, note in ((recorder.close, cut_off), (lambda: None, '')):
        # As a page that is killed leaves it, and as one that ends it.
        recording = open_recording(recorder.path)
        assert (recording.kind, recording.accuracy_s) == ('', BY_HAND_S)
        assert recording.channel_names == CONFIG.names
        (piece,) = recording.rows()
        assert piece.volts[:, 0].tolist() == [*range(15, 15 + len(truth))]
        assert piece.truth.tolist() == truth
        listed = RecordedFolder(tmp_path)
        asyncio.run(listed.refresh())
        assert listed.recordings['slip_1'].note.startswith(note)
        end()


def test_a_recording_of_another_rate_is_not_tuned_on_and_that_is_said(recorded):
    for name in ('slip_1', 'slip_2', 'slip_3'):
        written(recorded.folder, name, slips=1)
    recorded.sample_rate_hz = 100.0
    asyncio.run(recorded.refresh())
    assert recorded.off_rate('slip_3') == ''
    rows = Samples(np.zeros((100, 2)), np.arange(100) * 9_000_000, np.arange(100) > 50)
    write_recording(recorded.folder / 'slip_4', [rows], 111.1, ['a', 'b'])
    recorded.add(RecordingSummary('slip_4', 1.0, 1))  # It was just made.
    assert recorded.off_rate('slip_4') == 'has 111.1 Hz by its stamps, the detector 100 Hz'
    assert held_out(recorded) == ['slip_2']
