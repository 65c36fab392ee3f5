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

"""hand.launch.py with the live page, run by launch_testing."""

import asyncio
import re
import unittest
from pathlib import Path

import pytest

from support.harness import DEADLINE_S
from support.launching import check_ends, launch_testing, launched
from support.live_client import LiveClient

TASKS = Path('/proc/self/task')

ARGUMENTS = {
    'namespace': 'left',
    'fingers': 'thumb, index',
    'view': 'true',
    'view_options': '--port 0 --read-only',
    'transport': 'udp',
}


@pytest.mark.launch_test
def generate_test_description():
    return launched('hand', ARGUMENTS)


class TestPage(unittest.TestCase):
    def test_the_page_has_the_fingers_their_slips_and_their_file(self, proc_output):
        proc_output.assertWaitFor('slip_view: http://', timeout=DEADLINE_S, stream='stdout')
        output = ''.join(line.text.decode() for line in proc_output)
        address = re.search(r'slip_view: (http://\S+)', output)[1]

        async def view():
            page = await LiveClient.open(address)
            message = await page.until('fingers', lambda content: len(content['fingers']) == 2)
            labels = [finger['label'] for finger in message['fingers']]
            assert labels == ['left/index', 'left/thumb']
            assert message['read_only']
            await page.view()
            slipped = set()
            while len(slipped) < 2:
                header, _ = await page.drawn_frame()
                slipped |= {state['name'] for state in header['fingers'] if state['slip']}
            message = await page.until('parameters', lambda content: len(content['fingers']) == 2)
            files = {Path(finger['file']).name for finger in message['fingers'].values()}
            assert files == {'slip_detector.yaml'}
            assert not any(finger['differs'] for finger in message['fingers'].values())
            page.close()

        asyncio.run(asyncio.wait_for(view(), DEADLINE_S))
        # The launch runs in this process.
        nodes = [pid for file in TASKS.glob('*/children') for pid in file.read_text().split()]
        maps = [Path(f'/proc/{pid}/maps').read_text() for pid in nodes]
        shares = [('libfast' in text, '/dev/shm/fast' in text) for text in maps]
        assert shares == [(True, False)] * 3


@launch_testing.post_shutdown_test()
class TestEnd(unittest.TestCase):
    def test_all_processes_end_with_exit_code_0(self, proc_info, bench):
        check_ends(bench, proc_info, 3)
