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


"""Rest, slips and taps are recorded as somebody in front of the page says."""

import contextlib
import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters import DetectorConfig
from slip_detector.recordings import open_recording
from slip_detector.view import teaching as teaching_module
from slip_detector.view.detectors import Finger
from slip_detector.view.recorded_folder import NO_SLIP
from slip_detector.view.teaching import AFTER_S, BEFORE_S, GONE, INTERRUPTED, Teaching
from support.full_disk import full_disk
from support.simulated_detectors import SimulatedDetectors

FINGER = '/index/slip_detector'


class Lesson:
    """A simulated finger, somebody who teaches it, and the time that the test lets pass."""

    def __init__(self, folder):
        self.detectors = SimulatedDetectors(real_time=False)
        self.folder = folder
        self.teaching = Teaching(self.detectors, folder)

    @property
    def finger(self):
        return self.detectors.fingers[FINGER]

    def play(self, seconds):
        """Let time pass as a server does, a tenth of a second at a time."""
        for _ in range(round(10 * seconds)):
            self.detectors.simulated[FINGER].play(0.1)
            self.teaching.hold()
            self.teaching.tick()

    def slip(self, seconds=1.0, before=3.0, after=AFTER_S + 0.5):
        self.play(before)
        self.teaching.press(FINGER)
        self.play(seconds)
        self.teaching.release(FINGER)
        self.play(after)

    def listed(self):
        return {one['name']: one for one in self.teaching.described()[FINGER]['recordings']}

    def read(self, name):
        """Return stamps and truth of a recording."""
        pieces = [*open_recording(self.folder / 'index' / name).rows()]
        stamps_ns = np.concatenate([piece.stamps_ns for piece in pieces])
        return stamps_ns, np.concatenate([piece.truth for piece in pieces])


@pytest.fixture
def lesson(tmp_path):
    taught = Lesson(tmp_path)
    yield taught
    taught.teaching.close()


def seconds(stamps_ns):
    return (stamps_ns[-1] - stamps_ns[0]) * 1e-9


def test_the_recording_of_a_slip_has_rest_before_and_after_it(lesson):
    lesson.slip(seconds=0.5)
    stamps_ns, truth = lesson.read('slip_1')
    since_s = (stamps_ns - stamps_ns[0]) * 1e-9
    assert since_s[truth][0] == pytest.approx(BEFORE_S, abs=0.01)
    assert since_s[truth][-1] == pytest.approx(BEFORE_S + 0.5, abs=0.01)
    assert since_s[-1] >= BEFORE_S + 0.5 + AFTER_S - 0.01
    listed = lesson.listed()['slip_1']
    assert (listed['slips'], listed['duration_s']) == (1, pytest.approx(since_s[-1], abs=0.1))


def test_each_slip_is_a_recording_and_none_has_rows_of_a_slip_as_rest(lesson):
    for pause in (3.0, 0.3, 2.0, 0.5):
        lesson.slip(before=pause, after=0.2)
    lesson.play(2.0)
    recordings = [lesson.read(name) for name in lesson.listed()]
    assert len(recordings) == 4
    slips = np.concatenate([stamps_ns[truth] for stamps_ns, truth in recordings])
    for stamps_ns, truth in recordings:
        assert np.count_nonzero(np.diff(truth.astype(int), prepend=0) == 1) == 1
        assert not np.isin(stamps_ns[~truth], slips).any()


def test_little_rest_before_a_slip_is_said(lesson):
    lesson.play(0.4)
    lesson.teaching.press(FINGER)
    assert '0.4 s of rest before' in lesson.teaching.words


def test_rows_before_a_pause_of_the_sensor_are_no_rest_before_a_slip(lesson):
    # A clock that is set forward is the same.
    lesson.play(5.0)
    lesson.detectors.simulated[FINGER].at_ns += 60_000_000_000
    lesson.slip(before=0.4)
    stamps_ns, truth = lesson.read('slip_1')
    assert (stamps_ns[truth][0] - stamps_ns[0]) * 1e-9 == pytest.approx(0.4, abs=0.01)
    assert seconds(stamps_ns) < 5.0


def test_a_slip_during_which_no_sample_came_is_said_to_be_none(lesson):
    lesson.play(2.0)
    lesson.teaching.press(FINGER)
    lesson.teaching.release(FINGER)
    lesson.play(AFTER_S + 0.5)
    assert 'no sample came while the key was held' in lesson.teaching.words
    _, truth = lesson.read('slip_1')
    assert not truth.any()
    listed = lesson.listed()['slip_1']
    assert listed['slips'] == 0
    assert listed['note'].startswith(NO_SLIP)
    assert lesson.teaching.folder_of(FINGER).of_kind('slip') == []


def test_only_one_thing_is_recorded_at_a_time_and_another_finger_does_not_end_it(lesson):
    lesson.detectors.add('thumb', DetectorConfig())
    lesson.play(2.0)
    lesson.teaching.press(FINGER)
    for act in (
        lambda: lesson.teaching.press('/thumb/slip_detector'),
        lambda: lesson.teaching.start(FINGER, 'rest'),
    ):
        with pytest.raises(ValueError, match='slip_1 of index is being recorded'):
            act()
    lesson.teaching.release('/thumb/slip_detector')
    assert lesson.teaching.recording()['slipping']


def test_a_slip_ends_when_the_page_that_holds_it_is_gone(lesson, monkeypatch):
    lesson.play(2.0)
    lesson.teaching.press(FINGER)
    lesson.play(1.0)
    monkeypatch.setattr(teaching_module, 'HELD_S', -1.0)
    lesson.play(0.1)
    gone = 'slip_1: the page that held the slip is gone, so the slip was ended'
    assert lesson.teaching.words == gone
    lesson.play(AFTER_S + 0.5)
    _, truth = lesson.read('slip_1')
    assert truth.any()
    assert not truth[-1]


def test_a_driver_that_is_silent_is_said_until_samples_come(lesson, monkeypatch):
    lesson.teaching.start(FINGER, 'rest')
    lesson.play(1.0)
    assert lesson.teaching.recording()['silent'] == ''
    monkeypatch.setattr(teaching_module, 'SILENT_S', -1.0)
    assert 'no samples come' in lesson.teaching.recording()['silent']


def test_nothing_is_kept_of_a_recording_without_a_sample(lesson):
    lesson.teaching.start(FINGER, 'rest')
    lesson.teaching.stop()
    assert lesson.teaching.words == 'rest_1: no sample came, so there is no recording'
    assert [*(lesson.folder / 'index').iterdir()] == []


def detector_goes(lesson):
    lesson.detectors.fingers.pop(FINGER)


def clock_is_set_back(lesson):
    lesson.detectors.simulated[FINGER].at_ns -= 10_000_000_000
    lesson.detectors.simulated[FINGER].play(0.1)


def ten_minutes_pass(lesson):
    lesson.teaching._begun_at_s -= teaching_module.MOST_S


@pytest.mark.parametrize(
    ('event', 'why'),
    [
        (detector_goes, GONE),
        (clock_is_set_back, INTERRUPTED),
        (ten_minutes_pass, 'It was ended after 10 minutes'),
    ],
)
def test_a_recording_ends_by_itself_and_what_came_before_is_kept(lesson, event, why):
    lesson.teaching.start(FINGER, 'rest')
    lesson.play(2.0)
    event(lesson)
    lesson.teaching.tick()
    assert lesson.teaching.recording() is None
    assert lesson.teaching.words == f'rest_1 has 2.0 s. {why}'
    assert seconds(lesson.read('rest_1')[0]) == pytest.approx(2.0, abs=0.01)


def test_a_detector_with_another_rate_begins_anew_and_slips_are_recorded_still(lesson):
    lesson.slip()
    lesson.teaching.start(FINGER, 'rest')
    lesson.play(1.0)
    slower = dataclasses.replace(lesson.finger.config, sample_rate_hz=200.0, stopbands_hz=())
    lesson.finger.update_config(slower)
    lesson.detectors.simulated[FINGER].change(slower)
    lesson.play(1.0)
    assert 'rest_1 has 1.0 s' in lesson.teaching.words
    lesson.slip()
    stamps_ns, truth = lesson.read('slip_2')
    assert truth.any()
    assert seconds(stamps_ns) == pytest.approx(BEFORE_S + 1.0 + AFTER_S, abs=0.15)


def test_on_a_full_disk_what_was_recorded_is_kept_and_it_is_said(lesson):
    lesson.teaching.start(FINGER, 'rest')
    lesson.play(2.0)
    size = (lesson.folder / 'index/rest_1/rest_1.mcap').stat().st_size
    with full_disk(size + 1000):
        lesson.play(1.0)
    assert lesson.teaching.recording() is None
    assert 'rest_1 has 2.0 s, which are kept' in lesson.teaching.words
    assert 'File too large' in lesson.teaching.words
    assert seconds(lesson.read('rest_1')[0]) >= 1.99
    # There is room again, and the next recording is as any other.
    lesson.teaching.start(FINGER, 'rest')
    lesson.play(1.0)
    lesson.teaching.stop()
    assert [*lesson.listed()] == ['rest_1', 'rest_2']


def test_on_a_disk_that_is_full_from_the_beginning_it_is_said_and_nothing_is_left(lesson):
    lesson.play(3.0)
    with (
        full_disk(1000),
        pytest.raises(ValueError, match=r'slip_1 was cut off: .*File too large.*; nothing of it'),
    ):
        lesson.teaching.press(FINGER)
    assert lesson.teaching.recording() is None
    assert not lesson.listed()
    assert not (lesson.folder / 'index' / 'slip_1').exists()


def test_a_recording_whose_folder_disappears_is_said_to_be_lost_and_the_next_is_made(lesson):
    lesson.teaching.start(FINGER, 'rest')
    lesson.play(2.0)
    shutil.rmtree(lesson.folder / 'index')
    lesson.play(1.0)
    assert lesson.teaching.recording() is None
    assert 'No such file' in lesson.teaching.words
    assert lesson.teaching.words.endswith('; nothing of it is left')
    assert not lesson.listed()
    lesson.teaching.start(FINGER, 'rest')
    lesson.play(1.0)
    lesson.teaching.stop()
    assert [*lesson.listed()] == ['rest_1']


def test_a_folder_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / 'file').write_text('no folder')
    lesson = Lesson(tmp_path / 'file')
    with pytest.raises(ValueError, match='cannot be written'):
        lesson.teaching.start(FINGER, 'rest')
    assert lesson.teaching.recording() is None


def test_another_server_finds_what_was_recorded_and_what_was_cut_off(lesson):
    lesson.slip()
    lesson.teaching.start(FINGER, 'rest')
    lesson.play(2.0)  # and then the process is killed
    folder = Lesson(lesson.folder).teaching.folder_of(FINGER)
    folder.look()
    assert {n: (one.slips, bool(one.note)) for n, one in folder.recordings.items()} == {
        'rest_1': (0, True),
        'slip_1': (1, False),
    }
    assert folder.recordings['rest_1'].duration_s == pytest.approx(2.0, abs=0.01)


def test_a_recording_that_is_being_written_is_not_deleted(lesson):
    lesson.teaching.start(FINGER, 'rest')
    lesson.play(1.0)
    lesson.teaching.folder_of(FINGER).look()
    with pytest.raises(ValueError, match='is being recorded'):
        lesson.teaching.delete(FINGER, 'rest_1')


HOSTILE = st.one_of(
    st.text(max_size=30),
    st.sampled_from(
        ['..', '../victim', '/etc', 'rest_1/../../victim', 'rest_1', 'rest_0', 'slip_1', 'tuning']
    ),
    st.integers(),
    st.none(),
    st.lists(st.text(), max_size=2),
)


@given(
    finger=st.one_of(st.just(FINGER), HOSTILE),
    do=st.sampled_from(['start', 'press', 'delete', 'folder']),
    what=st.one_of(st.sampled_from(['rest', 'taps']), HOSTILE),
)
def test_nothing_that_a_page_sends_leaves_the_folder(tmp_path_factory, finger, do, what):
    around = tmp_path_factory.mktemp('around')
    (around / 'victim').mkdir()
    (around / 'victim' / 'victim.mcap').write_text('as it was')
    teaching, known = taught_without_a_chain(around / 'recordings', FINGER)
    acts = {
        'start': lambda: teaching.start(finger, what),
        'press': lambda: teaching.press(finger),
        'delete': lambda: teaching.delete(finger, what),
        'folder': lambda: teaching.folder_of(finger).path_of(what),
    }
    with contextlib.suppress(ValueError):
        acts[do]()
    known.track.add_samples(np.arange(9), np.zeros((9, 16)), np.zeros(9))
    teaching.close()
    assert {path.name for path in around.iterdir()} <= {'victim', 'recordings'}
    assert (around / 'victim' / 'victim.mcap').read_text() == 'as it was'
    inside = [path.relative_to(around) for path in (around / 'recordings').rglob('*')]
    assert all(path.parts[:2] == ('recordings', 'index') for path in inside)


@given(label=st.text(max_size=20))
def test_a_finger_whose_name_is_no_name_of_ros_has_no_folder(label):
    teaching, finger = taught_without_a_chain(Path('recordings'), f'/{label}/slip_detector')
    try:
        folder = teaching.folder_of(finger.name).folder
    except ValueError:
        return
    assert folder.parts[0] == 'recordings'
    assert not {'..', '/'} & set(folder.parts)


def taught_without_a_chain(folder, name):
    """A hand with one finger that only has a track, and who teaches it."""
    detectors = SimulatedDetectors(labels=())
    finger = detectors.fingers[name] = Finger(name, DetectorConfig())
    return Teaching(detectors, folder), finger
