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


"""Any request of a page is answered in one line."""

import asyncio
import contextlib
import json

from fuzz.fuzzing import STRANGE, fuzz
from hypothesis import strategies as st

from slip_detector.parameters import DetectorConfig, DriverConfig
from slip_detector.recordings import write_recording
from slip_detector.view.access import Access
from slip_detector.view.bag import PlayedBag
from slip_detector.view.parameters import ParameterRequests
from slip_detector.view.server import Server
from slip_detector.view.teaching import Teaching
from support.bags import rows
from support.simulated_detectors import SimulatedDetectors

FINGER = '/index/slip_detector'

#: What requests have, with values that are taken.
USUAL = {
    'finger': FINGER, 'recording': 'slip_1', 'slip_s': [[1.0, 1.5]], 'pixel_s': 0.1, 'name': 'a',
    'values': {'threshold': '0.25'}, 'preset': 'onset', 'fingers': [FINGER], 'replace': True,
    'page': '1-2', 'kind': 'rest', 'speed': 2.0, 'to_s': 1.0, 'playing': True, 'id': 7,
}  # fmt: skip

WORST = 10**400, '9' * 400, '\ud800', '\n\x1b[2J', float('nan'), [[[[1]]]], {'gain': 10**400}


def test_any_request_is_answered_in_one_line_and_logs_none(tmp_path, caplog):
    bag = tmp_path / 'index' / 'slip_1'
    bag.parent.mkdir()
    write_recording(bag, [rows(570, channels=16)], 380.0, [f'ch{c}' for c in range(16)])
    server = Server(SimulatedDetectors(real_time=False), Access())
    ParameterRequests(server, tmp_path)
    Teaching(server, tmp_path)
    PlayedBag(server, bag, DetectorConfig(), DriverConfig(), FINGER).read()

    async def answer_of(message):
        answer = await server.answer(message)
        await asyncio.sleep(0)  # A tuning begins.
        begun = asyncio.all_tasks() - {asyncio.current_task()}
        for task in begun:
            task.cancel()
        await asyncio.gather(*begun, return_exceptions=True)
        return answer

    def check(case):
        kind, changes = case
        answer = loop.run_until_complete(answer_of({'type': kind, **USUAL, **changes}))
        json.dumps(answer).encode()
        server.tick()
        assert [line for line in caplog.messages if not line.startswith('compiling')] == []
        if answer['refusal']:
            raise ValueError(answer['refusal'])

    kinds = sorted(server.requests)
    hostile = st.one_of(STRANGE, st.sampled_from(WORST))
    changed = st.dictionaries(st.sampled_from([*USUAL]), hostile, min_size=1, max_size=3)
    corpus = [(kind, {name: value}) for kind in kinds for name in USUAL for value in WORST]
    cases = st.tuples(st.sampled_from(kinds), changed)
    with contextlib.closing(asyncio.new_event_loop()) as loop:
        fuzz(cases, check, corpus=corpus, few=50, refusal='^[^\x00-\x1f\ud800-\udfff]*$')
        loop.run_until_complete(server.close())
