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
import dataclasses
import json
import re
import shutil
import time

import numpy as np
import pytest

from slip_detector.parameters import DetectorConfig, DriverConfig
from slip_detector.recordings import open_recording
from slip_detector.view import teaching as teaching_module
from slip_detector.view.access import Access
from slip_detector.view.bag import PlayedBag
from slip_detector.view.parameters import ParameterRequests
from slip_detector.view.recordings import NO_SLIP
from slip_detector.view.server import READ_ONLY, Server
from slip_detector.view.teaching import AFTER_S, BEFORE_S, GONE, Teaching
from slip_detector.view.tuning import TuneRun
from support.limits import full_disk
from support.simulated_detectors import SimulatedDetectors
from support.training import write_recordings

FINGER = '/index/slip_detector'

#: What names no recording.
NO_NAMES = '..', '../victim', '/etc', 'rest_1/../../victim', 'rest_0', 'tuning', '', 7, None, ['']


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
            if self.teaching._recorder:
                self.teaching._recorder.held_s = time.monotonic()  # The key is held.
            self.server.tick()

    async def ask(self, request, **content):
        """Return why a page's request was refused, '' where it was not."""
        answer = await self.server.answer({'type': request, 'finger': FINGER} | content)
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


def seconds(stamps_ns):
    return (stamps_ns[-1] - stamps_ns[0]) * 1e-9


async def test_each_slip_is_a_recording_with_rest_around_it_and_without_other_slips(taught):
    for pause in (3.0, 0.3, 2.0, 0.5):
        taught.play(pause)
        await taught.ask('begin_slip')
        taught.play(0.5)
        await taught.ask('end_slip')
        taught.play(0.2)
    taught.play(2.0)
    listed = taught.listed()
    recordings = [taught.read(name) for name in listed]
    assert [one['slips'] for one in listed.values()] == [1, 1, 1, 1]
    slips = np.concatenate([stamps_ns[truth] for stamps_ns, truth in recordings])
    for stamps_ns, truth in recordings:
        assert np.count_nonzero(np.diff(truth.astype(int), prepend=0) == 1) == 1
        assert not np.isin(stamps_ns[~truth], slips).any()
    stamps_ns, truth = recordings[2]
    since_s = (stamps_ns - stamps_ns[0]) * 1e-9
    assert since_s[truth][[0, -1]] == pytest.approx([BEFORE_S, BEFORE_S + 0.5], abs=0.01)
    stamps_ns, truth = recordings[3]
    assert (stamps_ns[-1] - stamps_ns[truth][-1]) * 1e-9 == pytest.approx(AFTER_S, abs=0.11)


async def test_a_slip_during_which_no_sample_came_is_said_to_be_none(taught):
    taught.play(2.0)
    await taught.ask('begin_slip')
    await taught.ask('end_slip')
    taught.play(AFTER_S + 0.5)
    assert 'no sample came while the key was held' in taught.teaching.words
    assert not taught.read('slip_1')[1].any()
    listed = taught.listed()['slip_1']
    assert (listed['slips'], listed['usable']) == (0, False)
    assert listed['note'].startswith(NO_SLIP)


async def test_one_thing_is_recorded_at_a_time_until_its_own_finger_ends(taught, monkeypatch):
    thumb = taught.detectors.add('thumb', DetectorConfig()).finger.name
    taught.play(0.4)
    await taught.ask('begin_slip')
    assert 'It has 0.4 s of rest before: wait' in taught.teaching.words
    await taught.teaching.folder_of(taught.finger).refresh()
    assert 'slip_1 of index: ' in taught.latest('recording')['recording']['words']
    monkeypatch.setattr(teaching_module, 'SILENT_S', -1.0)
    assert 'No samples come' in taught.latest('recording')['recording']['words']
    for kind, content in (('begin_slip', {'finger': thumb}), ('record', {'kind': 'rest'})):
        assert re.match('slip_1.* is being recorded', await taught.ask(kind, **content))
    await taught.ask('end_slip', finger=thumb)
    assert taught.latest('recording')['recording']['slipping']


async def test_a_slip_ends_when_the_page_that_holds_it_is_gone(taught, monkeypatch):
    taught.play(2.0)
    await taught.ask('begin_slip')
    taught.play(1.0)
    taught.teaching._recorder.held_s -= 10.0
    await taught.ask('hold_slip')
    assert taught.latest('recording')['recording']['slipping']
    monkeypatch.setattr(teaching_module, 'PRESSED_S', -1.0)
    taught.play(0.1)
    assert taught.teaching.words == 'slip_1: the page that held the slip is gone, so it ended'
    taught.play(AFTER_S + 0.5)
    assert not taught.read('slip_1')[1][-1]
    assert taught.listed()['slip_1']['slips'] == 1


def clock_is_set_back(taught):
    taught.detectors.simulated[FINGER].at_ns -= 10_000_000_000
    taught.detectors.simulated[FINGER].play(0.1)


def ten_minutes_pass(taught):
    taught.teaching._recorder.begun_s -= teaching_module.MOST_S


@pytest.mark.parametrize(
    ('event', 'why'),
    [
        (lambda taught: taught.detectors.fingers.pop(FINGER), GONE),
        (clock_is_set_back, GONE),
        (ten_minutes_pass, 'It was ended after 10 minutes'),
    ],
)
async def test_a_recording_ends_by_itself_and_what_came_before_is_kept(taught, event, why):
    await taught.ask('record', kind='rest')
    taught.play(2.0)
    event(taught)
    taught.server.tick()
    assert taught.latest('recording')['recording'] is None
    assert taught.teaching.words == f'rest_1 has 2.0 s. {why}'
    assert seconds(taught.read('rest_1')[0]) == pytest.approx(2.0, abs=0.01)


async def test_what_cannot_be_written_is_said_and_the_next_recording_is_as_any_other(taught):
    await taught.ask('record', kind='rest')
    taught.play(2.0)
    with full_disk((taught.folder / 'index/rest_1/rest_1.mcap').stat().st_size + 1000):
        taught.play(1.0)
    assert taught.latest('recording')['recording'] is None
    assert taught.teaching.words.startswith('rest_1 has 2.0 s. It was cut off: ')
    assert 'File too large' in taught.teaching.words
    assert seconds(taught.read('rest_1')[0]) >= 1.99
    with full_disk(1000):
        await taught.ask('begin_slip')
        taught.server.tick()
    assert taught.teaching.words.startswith('slip_1 has no sample, so it is not kept. It was cut')
    await taught.ask('record', kind='taps')
    await taught.ask('stop_recording')
    assert taught.teaching.words == 'taps_1 has no sample, so it is not kept'
    await taught.ask('record', kind='rest')
    taught.play(1.0)
    shutil.rmtree(taught.folder / 'index' / 'rest_2')
    taught.play(1.0)
    assert 'No such file' in taught.teaching.words
    await taught.ask('record', kind='rest')
    taught.play(1.0)
    await taught.ask('stop_recording')
    assert [*taught.listed()] == ['rest_1', 'rest_2']


@pytest.mark.parametrize('name', NO_NAMES)
async def test_nothing_that_a_page_sends_leaves_the_folder(tmp_path, name):
    victim = tmp_path / 'victim' / 'victim.mcap'
    victim.parent.mkdir()
    victim.write_text('as it was')
    one = Taught(tmp_path / 'recordings')
    for kind, content in (
        ('record', {'finger': name, 'kind': 'rest'}),
        ('record', {'kind': name}),
        ('begin_slip', {'finger': name}),
        ('delete_recording', {'finger': name, 'recording': 'rest_1'}),
        ('delete_recording', {'recording': name}),
    ):
        assert re.match('there is no|.* is .*, allowed: ', await one.ask(kind, **content))
    assert {path.name for path in tmp_path.iterdir()} == {'victim'}
    assert victim.read_text() == 'as it was'


async def test_a_finger_is_watched_while_it_is_recorded_at_most_until_the_server_ends(taught):
    await taught.ask('record', kind='rest')
    taught.play(2.0)
    assert taught.detectors.watched == {FINGER}
    shown = taught.latest('recording')['recording']
    assert (shown['words'], shown['slipping']) == ('rest_1 of index: 2.0 s', False)
    await taught.ask('stop_recording')
    taught.play(0.1)
    assert taught.detectors.watched == set()
    assert taught.latest('recording')['recording'] is None
    await taught.ask('record', kind='taps')
    taught.play(1.0)
    await taught.server.close()
    assert open_recording(taught.folder / 'index' / 'taps_1').kind == 'taps'


async def test_a_page_that_may_only_look_is_answered_only_what_changes_nothing(tmp_path):
    write_recordings(tmp_path / 'index', slips=0)
    before = sorted(tmp_path.rglob('*'))
    one = Taught(tmp_path, read_only=True)
    ParameterRequests(one.server, tmp_path)
    bag = tmp_path / 'index' / 'rest_1'
    PlayedBag(one.server, bag, DetectorConfig(), DriverConfig(), FINGER).read()
    asked = {kind: await one.ask(kind) for kind in one.server.requests}
    answered = {kind for kind, refusal in asked.items() if refusal != READ_ONLY}
    assert answered == {'recordings', 'trace', 'bag_trace'}
    assert sorted(tmp_path.rglob('*')) == before


async def test_tuning_runs_once_keeps_its_recordings_and_ends_with_the_server(taught):
    write_recordings(taught.folder / 'index', slips=2)
    refusals = await asyncio.gather(taught.ask('tune'), taught.ask('tune'))
    assert sorted(refusals) == ['', 'tuning runs already, allowed: one at a time']
    for kind in ('delete_recording', 'mark_recording'):
        assert 'are being tuned on' in await taught.ask(kind, recording='slip_1')
    run = taught.teaching._run
    while taught.latest()['tuning']['step'] != 'reading the recordings':
        await asyncio.sleep(0.02)
    await taught.server.close()
    assert run._process.returncode == -9
    assert not run.running
    # A later server offers to go on with trials for the same parameters that gave no result.
    ran, other = DetectorConfig(), DetectorConfig(threshold=0.3)
    trials, result = 'tuned.yaml.study.journal', 'tuned.yaml'
    for newest, config, offered in ((trials, ran, True), (trials, other, 0), (result, ran, 0)):
        (taught.folder / 'index' / 'tuning' / newest).touch()
        again = Taught(taught.folder)
        again.finger.config = config
        await again.ask('recordings')
        assert again.latest()['fingers'][FINGER]['interrupted'] == offered


async def test_what_was_found_is_applied_as_one_change_and_the_rest_stays(taught):
    finger, found = taught.finger, {'threshold': 0.25, 'groups': {'all': tuple(range(1, 17))}}
    folder = taught.teaching.folder_of(finger)
    run = taught.teaching._run = TuneRun(folder, FINGER, DetectorConfig())
    run.found = dataclasses.replace(finger.config, **found)
    # Meanwhile another program has changed what was compared, and what decides nothing.
    await taught.detectors.change(FINGER, {'gain': 7.0, 'heartbeat_hz': 5.0}, 'page 1')
    changes = finger.count
    assert await taught.ask('apply_tuning') == ''
    assert finger.config == dataclasses.replace(run.found, heartbeat_hz=5.0)
    assert finger.count == changes + 1
    assert await taught.ask('apply_tuning') == ''
    assert taught.latest()['words'].endswith('0 values set')
    for other in (DetectorConfig(channels=8), DetectorConfig(sample_rate_hz=400.0)):
        finger.config = other
        refusal = await taught.ask('apply_tuning')
        assert refusal.startswith('the detector has other channels or another rate now')


async def test_the_ends_of_a_label_are_seen_beside_the_decision_and_saved(taught):
    write_recordings(taught.folder / 'index', slips=1)
    await taught.ask('recordings')

    async def ask(kind, **content):
        request = {'type': kind, 'finger': FINGER, 'recording': 'slip_1', **content}
        return await taught.server.answer(request)

    seen = await ask('trace')
    ((start_s, end_s),) = seen['slip_s']
    assert seen['coverage'] > 0.9
    assert any(a < start_s and b > end_s - 0.4 for a, b in seen['on_s'])
    assert np.min(seen['level']) < 1.0 < np.max(seen['level']) <= 2.0
    assert seen['duration_s'] <= seen['bin_s'] * len(seen['level']) < seen['duration_s'] + 0.1
    late_s = [[start_s + 0.05, end_s + 0.07]]
    assert (await ask('label', slip_s=late_s, pixel_s=0.2))['refusal'] == ''
    assert open_recording(taught.folder / 'index' / 'slip_1').accuracy_s == 0.2
    assert 'begins before' in (await ask('label', slip_s=[[98, 99]]))['refusal']
    assert (await ask('label', slip_s=[]))['refusal'] == ''
    assert not taught.listed()['slip_1']['usable']


async def test_a_doubted_recording_is_marked_as_a_mistake_which_may_be_taken_back(taught):
    write_recordings(taught.folder / 'index', slips=2)
    await taught.ask('recordings')
    doubts = ['slip_2: nothing changes at its slips, at 2.0 s', 'rest_1: quiet']
    taught.teaching.folder_of(taught.finger).note_doubts(doubts)
    assert [name for name, its in taught.listed().items() if its['note']] == ['slip_2']
    for mistaken in (True, False):
        assert await taught.ask('mark_recording', recording='slip_2', mistaken=mistaken) == ''
        its = taught.listed()['slip_2']
        assert (its['mistaken'], its['usable'], its['note']) == (mistaken, not mistaken, '')
        about = {'type': 'trace', 'finger': FINGER, 'recording': 'slip_2'}
        trace = await taught.server.answer(about)
        assert len(trace['slip_s']) == (not mistaken)  # Those of the recording count again.
