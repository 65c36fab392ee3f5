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

"""slip_view as a process: its options, its end, and what it costs nobody."""

import asyncio
import re
import signal

import numpy as np
import pytest
from visualization_msgs.msg import MarkerArray

from slip_detector.nodes.messages import event_qos
from support.harness import DEADLINE_S
from support.live_client import LiveClient


def with_page(address, test):
    """Run a test with a page that is open."""

    async def run():
        page = await LiveClient.open(address)
        try:
            return await asyncio.wait_for(test(page), DEADLINE_S)
        finally:
            page.close()

    return asyncio.run(run())


def test_a_scene_is_played_and_all_ends_with_a_signal(bench, tmp_path):
    words = ('--scene', 'plate_400um', '--fingers', 'thumb,index', '--folder', str(tmp_path / 'f'))
    process, address = bench.start_view(*words)

    async def see(page):
        content = await page.until('fingers', lambda content: len(content['fingers']) == 2)
        assert [finger['label'] for finger in content['fingers']] == ['scene/index', 'scene/thumb']
        assert not bench.subscribed('slip_view')
        names = await page.view(channels=[14])
        slip = on = false = 0
        while not (slip and on and false):
            header, arrays = await page.drawn_frame()
            (state, _), traces = header['fingers'], header['traces']
            slip, on = slip + state['slip'], on + arrays['on/0'].any()
            false += state['valid'] and not state['slip']
            if traces['levels']['count']:
                assert traces['name'] == names[0]
                assert arrays['level'].shape == (1, traces['levels']['count'])

    with_page(address, see)
    bench.wait_for(lambda: not bench.subscribed('slip_view'), 'the subscriptions to end')
    taxels = bench.listen(MarkerArray, 'slip_view/taxels', event_qos(depth=1000))

    def marked(words):
        texts = [marker.text for array in taxels for marker in array.markers]
        return any(text.startswith(f'scene/index: {words}') for text in texts)

    bench.wait_for(lambda: marked('rest') and marked('SLIP '), 'rest and a slip as markers')

    async def end(page):
        for number in (signal.SIGINT, signal.SIGTERM):
            process.signal(number)
        while await page._socket.read_message() is not None:
            pass
        assert page._socket.close_reason == 'slip_view was stopped'

    with_page(address, end)
    assert process.wait() == 0
    assert 'Traceback' not in process.log()
    bench.wait_for(
        lambda: not set(bench.node.get_node_names()) & {'slip_detector', 'slip_driver'},
        'the nodes of the scene to end',
    )


def test_when_a_node_of_the_scene_ends_so_does_the_page(bench):
    words = ['--scene', 'plate_400um', '--fingers', 'thumb,thumb']
    process = bench.start_executable('slip_view', '--port', '0', *words)
    assert process.wait() == 1
    last = process.lines()[-1]
    assert re.fullmatch('slip_view: slip_(detector|driver) ended with the exit code 1', last)
    assert 'Traceback' not in process.log()


def test_beyond_loopback_the_printed_address_has_a_token_and_a_signal_ends_it(bench):
    process, address = bench.start_view('--host', '0.0.0.0')
    assert len(address.partition('?token=')[2]) >= 20
    process.end_quietly(*3 * [signal.SIGTERM])  # ros2 launch sends more than one.
    assert process.lines() == [f'slip_view: {address}', 'Ctrl-C ends it']


@pytest.mark.parametrize(
    ('words', 'code', 'said'),
    [
        (['--prot', '0'], 2, 'unrecognized arguments: --prot 0'),
        (['--config', 'none.yaml'], 1, "config is 'none.yaml', allowed: the path of a"),
        (['--host', '192.0.2.1'], 1, '--host 192.0.2.1 --port 8470 cannot be used (Cannot assign'),
        (['--ros-args', '-r', 'a b'], 1, "Couldn't parse remap rule: '-r a b'"),
    ],
)  # fmt: skip
def test_what_is_impossible_is_refused_in_one_line(bench, words, code, said):
    line = bench.start_executable('slip_view', *words).refusal(code)
    assert line.startswith('slip_view: ')
    assert said in line


def test_a_bag_for_a_detector_of_other_messages_is_played_to_it(bench, tmp_path):
    path, volts = tmp_path / 'old.npz', np.arange(6.0) + 1e-3 * (np.arange(500)[:, np.newaxis] % 7)
    np.savez(path, volts=volts, sample_rate_hz=500.0)
    words = ('--bag', str(path), '--config', 'sensors/wrench.yaml', '--folder', str(tmp_path))
    _, address = bench.start_view(*words)

    async def see(page):
        await page.view(channels=[2, 6])
        low = valid = None
        while low is None or not valid:
            header, arrays = await page.drawn_frame()
            valid = valid or header['fingers'][0]['valid']
            assert header['fingers'][0]['unfit'] == ''
            if header['traces']['samples']['count']:
                low = np.nanmin(arrays['low'], axis=1)
        assert low == pytest.approx([1.0, 5.0], abs=0.01)

    with_page(address, see)
