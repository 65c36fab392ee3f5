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


"""What pages ask when they teach, and what they are told."""

import asyncio
import contextlib
import dataclasses
import json
import os
import time

import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.access import Access
from slip_detector.view.parameter_requests import ParameterRequests
from slip_detector.view.server import READ_ONLY, Server
from slip_detector.view.teaching_requests import TeachingRequests
from support.lessons import write_lesson
from support.simulated_detectors import SimulatedDetectors

FINGER = '/index/slip_detector'

DEADLINE_S = 60.0


class Taught:
    """A server that is asked without a page."""

    def __init__(self, folder, **access):
        self.detectors = SimulatedDetectors(real_time=False)
        self.server = Server(self.detectors, Access(**access))
        self.requests = TeachingRequests(self.server, folder)

    async def ask(self, kind, **content):
        """Return why it was refused, ''  where it was not."""
        answer = await self.server.answer({'type': kind, 'finger': FINGER, **content})
        self.server.tick()
        return answer['refusal']

    def play(self, seconds):
        for _ in range(round(10 * seconds)):
            self.detectors.simulated[FINGER].play(0.1)
            self.server.tick()

    def told(self, kind='teaching'):
        return json.loads(self.server.news[kind])

    def names(self):
        return [one['name'] for one in self.told()['fingers'][FINGER]['recordings']]


@contextlib.asynccontextmanager
async def taught(folder, **access):
    one = Taught(folder, **access)
    try:
        yield one
    finally:
        await one.server.close()


async def test_a_finger_is_watched_while_it_is_recorded_at_most_until_the_server_ends(
    tmp_path,
):
    async with taught(tmp_path) as one:
        assert await one.ask('teach', do='rest') == ''
        one.play(2.0)
        assert one.detectors.watched == {FINGER}
        shown = one.told('recording')['recording']
        assert (shown['name'], shown['seconds'], shown['slipping']) == ('rest_1', 2.0, False)
        assert await one.ask('teach', do='stop') == ''
        one.play(0.1)
        assert one.detectors.watched == set()
        assert one.told('recording')['recording'] is None
        assert one.names() == ['rest_1']
        await one.ask('teach', do='taps')
        one.play(1.0)
    assert (tmp_path / 'index' / 'taps_1' / 'metadata.yaml').exists()


@pytest.mark.parametrize(
    ('kind', 'content', 'said'),
    [
        ('teach', {'do': 'dance'}, 'dance is not recorded so, allowed: rest, taps'),
        ('teach', {'do': 'rest', 'finger': '/thumb/slip_detector'}, 'there is no finger'),
        ('teach', {'do': ['rest']}, 'is not recorded so'),
        ('recordings', {'finger': 7}, "there is no finger '7'"),
        ('delete_recording', {'recording': '../slip_1'}, "there is no recording '../slip_1'"),
        ('tune', {}, 'there are 0 recordings of slips, allowed: two or more'),
        ('apply_tuning', {}, 'there is nothing to apply: tune first'),
    ],
)
async def test_impossible_requests_are_refused_in_words(tmp_path, kind, content, said):
    async with taught(tmp_path) as one:
        assert said in await one.ask(kind, **content)


async def test_a_page_that_may_only_look_is_answered_only_what_changes_nothing(tmp_path):
    async with taught(tmp_path, read_only=True) as one:
        ParameterRequests(one.server, tmp_path)
        asked = {kind: await one.ask(kind) for kind in one.server.requests}
        answered = {kind for kind, refusal in asked.items() if refusal != READ_ONLY}
        assert answered == {'recordings', 'hold_rest'}
        assert [*tmp_path.iterdir()] == []


async def test_tuning_keeps_recordings_and_ends_with_the_server(tmp_path):
    write_lesson(tmp_path / 'index', slips=2)

    async with taught(tmp_path) as one:
        assert await one.ask('tune') == ''
        run = one.requests._run
        deadline_s = time.monotonic() + DEADLINE_S
        while run._process is None:
            assert time.monotonic() < deadline_s
            await asyncio.sleep(0.01)
        one.server.tick()
        assert one.told()['tuning']['step'] == 'learning the noise of rest_1'
        assert 'tuning runs already' in await one.ask('tune')
        refusal = await one.ask('delete_recording', recording='slip_1')
        assert 'are being tuned on' in refusal
        child = run._process.pid
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)
    assert (tmp_path / 'index' / 'slip_1').exists()


async def test_one_of_two_pages_that_tune_at_once_is_refused(tmp_path):
    write_lesson(tmp_path / 'index', slips=2)

    async with taught(tmp_path) as one:
        refusals = await asyncio.gather(one.ask('tune'), one.ask('tune'))
        assert sorted(refusals) == ['', 'tuning runs already, allowed: one at a time']


async def test_a_finger_that_goes_while_its_recordings_are_read_is_not_tuned(tmp_path):
    write_lesson(tmp_path / 'index', slips=2)

    async with taught(tmp_path) as one:
        asked = asyncio.create_task(one.ask('tune'))
        await asyncio.sleep(0)
        one.detectors.remove('index')
        assert 'there is no finger' in await asked
        assert one.told()['tuning'] is None


@contextlib.asynccontextmanager
async def tuned(folder, **found):
    """Someone who has tuned, and found that."""
    async with taught(folder) as one:
        write_lesson(folder / 'index', slips=2)
        await one.ask('tune')
        run = one.requests._run
        run.kill()
        await asyncio.wait([one.requests._task])
        run.found = dataclasses.replace(one.detectors.fingers[FINGER].config, **found)
        yield one


async def test_tuned_parameters_are_applied_at_once_and_the_others_stay(tmp_path):
    async with tuned(tmp_path, threshold=0.25, groups={'all': tuple(range(1, 17))}) as one:
        # Meanwhile somebody has changed what was compared, and what decides nothing.
        await one.detectors.change(FINGER, {'gain': 7.0, 'heartbeat_hz': 5.0}, 'page 1')
        changes = one.detectors.panel(FINGER).count
        assert await one.ask('apply_tuning') == ''
        found = one.requests._run.found
        config = one.detectors.fingers[FINGER].config
        assert config == dataclasses.replace(found, heartbeat_hz=5.0)
        assert one.detectors.panel(FINGER).count == changes + 1
        assert await one.ask('apply_tuning') == ''
        assert one.told()['words'].endswith('0 values set')


async def test_a_refusal_of_tuned_parameters_is_in_the_detectors_words(tmp_path, monkeypatch):
    async def refused(name, values):
        return f'parameter threshold is {values["threshold"]}, allowed: more'

    async with tuned(tmp_path, threshold=0.25) as one:
        monkeypatch.setattr(one.detectors, 'set_parameters', refused)
        refusal = await one.ask('apply_tuning')
        assert refusal == 'parameter threshold is 0.25, allowed: more'


async def test_tuned_parameters_are_not_applied_to_other_channels_or_a_gone_finger(
    tmp_path,
):
    async with tuned(tmp_path, threshold=0.25) as one:
        finger = one.detectors.fingers[FINGER]
        for other in (DetectorConfig(channels=8), DetectorConfig(sample_rate_hz=400.0)):
            finger.config = other
            refusal = await one.ask('apply_tuning')
            assert refusal.startswith('16 channels at 380 Hz were taught')
            assert finger.config is other
        one.detectors.remove('index')
        assert 'there is no finger' in await one.ask('apply_tuning')
