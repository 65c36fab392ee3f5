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


"""Rest, slips and taps are recorded, and tuned on, as a page requests."""

import asyncio
import contextlib
import dataclasses
import json
import shutil

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.parameters import DetectorConfig
from slip_detector.recordings import open_recording
from slip_detector.view import teaching as teaching_module
from slip_detector.view.detectors import Finger
from slip_detector.view.parameters import ParameterRequests
from slip_detector.view.recordings import NO_SLIP
from slip_detector.view.server import READ_ONLY, Access, Server
from slip_detector.view.teaching import (
    AFTER_S,
    BEFORE_S,
    GONE,
    INTERRUPTED,
    Teaching,
)
from support.full_disk import full_disk
from support.simulated_detectors import SimulatedDetectors
from support.training import write_recordings

FINGER = '/index/slip_detector'


class Taught:
    """A simulated finger that is taught, and the time that the test lets pass."""

    def __init__(self, folder, **access):
        self.detectors = SimulatedDetectors(real_time=False)
        self.folder = folder
        self.server = Server(self.detectors, Access(**access))
        self.teaching = Teaching(self.server, folder)

    @property
    def finger(self):
        return self.detectors.fingers[FINGER]

    def play(self, seconds):
        """Let time pass as a server does, a tenth of a second at a time."""
        for _ in range(round(10 * seconds)):
            self.detectors.simulated[FINGER].play(0.1)
            self.teaching.still_pressed()
            self.server.tick()

    def slip(self, seconds=1.0, before=3.0, after=AFTER_S + 0.5):
        self.play(before)
        self.teaching.press(FINGER)
        self.play(seconds)
        self.teaching.release(FINGER)
        self.play(after)

    async def ask(self, kind, **content):
        """Return why a page's request was refused, '' where it was not."""
        answer = await self.server.answer({'type': kind, 'finger': FINGER, **content})
        self.server.tick()
        return answer['refusal']

    def latest(self, kind='teaching'):
        self.server.tick()
        return json.loads(self.server.news[kind])

    def listed(self):
        return {one['name']: one for one in self.latest()['fingers'][FINGER]['recordings']}

    def read(self, name):
        """Return stamps and truth of a recording."""
        pieces = [*open_recording(self.folder / 'index' / name).rows()]
        stamps_ns = np.concatenate([piece.stamps_ns for piece in pieces])
        return stamps_ns, np.concatenate([piece.truth for piece in pieces])


@pytest.fixture
def taught(tmp_path):
    one = Taught(tmp_path)
    yield one
    asyncio.run(one.server.close())


@contextlib.asynccontextmanager
async def requests(folder, **access):
    one = Taught(folder, **access)
    try:
        yield one
    finally:
        await one.server.close()


def seconds(stamps_ns):
    return (stamps_ns[-1] - stamps_ns[0]) * 1e-9


def test_the_recording_of_a_slip_has_rest_before_and_after_it(taught):
    taught.slip(seconds=0.5)
    stamps_ns, truth = taught.read('slip_1')
    since_s = (stamps_ns - stamps_ns[0]) * 1e-9
    assert since_s[truth][0] == pytest.approx(BEFORE_S, abs=0.01)
    assert since_s[truth][-1] == pytest.approx(BEFORE_S + 0.5, abs=0.01)
    assert since_s[-1] >= BEFORE_S + 0.5 + AFTER_S - 0.01
    listed = taught.listed()['slip_1']
    assert (listed['slips'], listed['duration_s']) == (1, pytest.approx(since_s[-1], abs=0.1))


def test_each_slip_is_a_recording_and_none_has_rows_of_a_slip_as_rest(taught):
    for pause in (3.0, 0.3, 2.0, 0.5):
        taught.slip(before=pause, after=0.2)
    taught.play(2.0)
    recordings = [taught.read(name) for name in taught.listed()]
    assert len(recordings) == 4
    slips = np.concatenate([stamps_ns[truth] for stamps_ns, truth in recordings])
    for stamps_ns, truth in recordings:
        assert np.count_nonzero(np.diff(truth.astype(int), prepend=0) == 1) == 1
        assert not np.isin(stamps_ns[~truth], slips).any()


def test_a_slip_during_which_no_sample_came_is_said_to_be_none(taught):
    taught.play(2.0)
    taught.teaching.press(FINGER)
    taught.teaching.release(FINGER)
    taught.play(AFTER_S + 0.5)
    assert 'no sample came while the key was held' in taught.teaching.words
    _, truth = taught.read('slip_1')
    assert not truth.any()
    listed = taught.listed()['slip_1']
    assert listed['slips'] == 0
    assert listed['note'].startswith(NO_SLIP)
    assert taught.teaching.folder_of(FINGER).of_kind('slip') == []


def test_only_one_thing_is_recorded_at_a_time_and_another_finger_does_not_end_it(
    taught, monkeypatch
):
    taught.detectors.add('thumb', DetectorConfig())
    taught.play(0.4)
    taught.teaching.press(FINGER)
    assert '0.4 s of rest before' in taught.teaching.words
    asyncio.run(taught.teaching.folder_of(FINGER).refresh())
    with pytest.raises(ValueError, match='is being recorded'):
        taught.teaching.delete(FINGER, 'slip_1')
    assert taught.teaching.recording()['silent'] == ''
    monkeypatch.setattr(teaching_module, 'SILENT_S', -1.0)
    assert 'no samples come' in taught.teaching.recording()['silent']
    for act in (
        lambda: taught.teaching.press('/thumb/slip_detector'),
        lambda: taught.teaching.start(FINGER, 'rest'),
    ):
        with pytest.raises(ValueError, match='slip_1 of index is being recorded'):
            act()
    taught.teaching.release('/thumb/slip_detector')
    assert taught.teaching.recording()['slipping']


def test_a_slip_ends_when_the_page_that_holds_it_is_gone(taught, monkeypatch):
    taught.play(2.0)
    taught.teaching.press(FINGER)
    taught.play(1.0)
    monkeypatch.setattr(teaching_module, 'PRESSED_S', -1.0)
    taught.play(0.1)
    gone = 'slip_1: the page that held the slip is gone, so the slip was ended'
    assert taught.teaching.words == gone
    taught.play(AFTER_S + 0.5)
    _, truth = taught.read('slip_1')
    assert truth.any()
    assert not truth[-1]


def detector_goes(taught):
    taught.detectors.fingers.pop(FINGER)


def clock_is_set_back(taught):
    taught.detectors.simulated[FINGER].at_ns -= 10_000_000_000
    taught.detectors.simulated[FINGER].play(0.1)


def ten_minutes_pass(taught):
    taught.teaching._begun_at_s -= teaching_module.MOST_S


@pytest.mark.parametrize(
    ('event', 'why'),
    [
        (detector_goes, GONE),
        (clock_is_set_back, INTERRUPTED),
        (ten_minutes_pass, 'It was ended after 10 minutes'),
    ],
)
def test_a_recording_ends_by_itself_and_what_came_before_is_kept(taught, event, why):
    taught.teaching.start(FINGER, 'rest')
    taught.play(2.0)
    event(taught)
    taught.server.tick()
    assert taught.teaching.recording() is None
    assert taught.teaching.words == f'rest_1 has 2.0 s. {why}'
    assert seconds(taught.read('rest_1')[0]) == pytest.approx(2.0, abs=0.01)


def test_on_a_full_disk_what_was_recorded_is_kept_and_it_is_said(taught):
    taught.teaching.start(FINGER, 'rest')
    taught.play(2.0)
    size = (taught.folder / 'index/rest_1/rest_1.mcap').stat().st_size
    with full_disk(size + 1000):
        taught.play(1.0)
    assert taught.teaching.recording() is None
    assert 'rest_1 has 2.0 s, which are kept' in taught.teaching.words
    assert 'File too large' in taught.teaching.words
    assert seconds(taught.read('rest_1')[0]) >= 1.99
    with full_disk(1000):
        taught.teaching.press(FINGER)
    assert taught.teaching.words.startswith('slip_1 was cut off: ')
    assert taught.teaching.words.endswith('; nothing of it is left')
    # There is room again, and the next recording is as any other; one without samples is removed.
    taught.teaching.start(FINGER, 'rest')
    taught.play(1.0)
    taught.teaching.stop()
    taught.teaching.start(FINGER, 'taps')
    taught.teaching.stop()
    assert taught.teaching.words == 'taps_1: no sample came, so there is no recording'
    assert [*taught.listed()] == ['rest_1', 'rest_2']


def test_a_recording_whose_folder_disappears_is_said_to_be_lost_and_the_next_is_made(taught):
    taught.teaching.start(FINGER, 'rest')
    taught.play(2.0)
    shutil.rmtree(taught.folder / 'index')
    taught.play(1.0)
    assert taught.teaching.recording() is None
    assert 'No such file' in taught.teaching.words
    assert taught.teaching.words.endswith('; nothing of it is left')
    assert not taught.listed()
    taught.teaching.start(FINGER, 'rest')
    taught.play(1.0)
    taught.teaching.stop()
    assert [*taught.listed()] == ['rest_1']


def test_another_server_finds_what_was_recorded_and_what_was_cut_off(taught):
    taught.slip()
    taught.teaching.start(FINGER, 'rest')
    taught.play(2.0)  # and then the process is killed
    folder = Taught(taught.folder).teaching.folder_of(FINGER)
    asyncio.run(folder.refresh())
    rest, slip = folder.recordings.values()
    assert (rest.slips, rest.note[:38]) == (0, 'was not ended: rest_1.mcap is cut off ')
    assert (slip.slips, slip.note) == (1, '')
    assert folder.recordings['rest_1'].duration_s == pytest.approx(2.0, abs=0.01)


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
    detectors = SimulatedDetectors(labels=())
    known = detectors.fingers[FINGER] = Finger(FINGER, DetectorConfig())
    teaching = Teaching(Server(detectors, Access()), around / 'recordings')
    acts = {
        'start': lambda: teaching.start(finger, what),
        'press': lambda: teaching.press(finger),
        'delete': lambda: teaching.delete(finger, what),
        'folder': lambda: teaching.folder_of(finger).path_of(what),
    }
    with contextlib.suppress(ValueError):
        acts[do]()
    known.track.add_samples(Samples(np.zeros((9, 16)), np.arange(9)))
    teaching.stop()
    assert {path.name for path in around.iterdir()} <= {'victim', 'recordings'}
    assert (around / 'victim' / 'victim.mcap').read_text() == 'as it was'
    inside = [path.relative_to(around) for path in (around / 'recordings').rglob('*')]
    assert all(path.parts[:2] == ('recordings', 'index') for path in inside)


async def test_a_finger_is_watched_while_it_is_recorded_at_most_until_the_server_ends(
    tmp_path,
):
    async with requests(tmp_path) as one:
        assert await one.ask('teach', do='rest') == ''
        one.play(2.0)
        assert one.detectors.watched == {FINGER}
        shown = one.latest('recording')['recording']
        assert (shown['name'], shown['seconds'], shown['slipping']) == ('rest_1', 2.0, False)
        assert await one.ask('teach', do='stop') == ''
        one.play(0.1)
        assert one.detectors.watched == set()
        assert one.latest('recording')['recording'] is None
        await one.ask('teach', do='taps')
        one.play(1.0)
    assert (tmp_path / 'index' / 'taps_1' / 'metadata.yaml').exists()


async def test_a_page_that_may_only_look_is_answered_only_what_changes_nothing(tmp_path):
    async with requests(tmp_path, read_only=True) as one:
        ParameterRequests(one.server, tmp_path)
        asked = {kind: await one.ask(kind) for kind in one.server.requests}
        answered = {kind for kind, refusal in asked.items() if refusal != READ_ONLY}
        assert answered == {'recordings', 'keep_rest'}
        assert [*tmp_path.iterdir()] == []


async def test_tuning_runs_once_keeps_its_recordings_and_ends_with_the_server(tmp_path):
    write_recordings(tmp_path / 'index', slips=2)
    async with requests(tmp_path) as one:
        refusals = await asyncio.gather(one.ask('tune'), one.ask('tune'))
        assert sorted(refusals) == ['', 'tuning runs already, allowed: one at a time']
        refusal = await one.ask('delete_recording', recording='slip_1')
        assert 'are being tuned on' in refusal
        run = one.teaching._run
        while not run.step:
            await asyncio.sleep(0.02)
        assert one.latest()['tuning']['step'] == 'learning the noise of rest_1'
    assert run._process.exitcode == -9
    assert not run.running


async def test_what_was_found_is_applied_as_one_change_and_the_rest_stays(tmp_path):
    write_recordings(tmp_path / 'index', slips=2)
    async with requests(tmp_path) as one:
        asked = asyncio.create_task(one.ask('tune'))
        await asyncio.sleep(0)
        finger = one.detectors.fingers.pop(FINGER)
        assert 'there is no finger' in await asked
        one.detectors.fingers[FINGER] = finger
        await one.ask('tune')
        run = one.teaching._run
        run.kill()
        await one.teaching._task
        found = {'threshold': 0.25, 'groups': {'all': tuple(range(1, 17))}}
        run.found = dataclasses.replace(finger.config, **found)
        # Meanwhile another program has changed what was compared, and what decides nothing.
        await one.detectors.change(FINGER, {'gain': 7.0, 'heartbeat_hz': 5.0}, 'page 1')
        changes = one.detectors.panel(FINGER).count
        assert await one.ask('apply_tuning') == ''
        assert finger.config == dataclasses.replace(run.found, heartbeat_hz=5.0)
        assert one.detectors.panel(FINGER).count == changes + 1
        assert await one.ask('apply_tuning') == ''
        assert one.latest()['words'].endswith('0 values set')
        for other in (DetectorConfig(channels=8), DetectorConfig(sample_rate_hz=400.0)):
            finger.config = other
            refusal = await one.ask('apply_tuning')
            assert refusal.startswith('16 channels at 380 Hz were taught')
