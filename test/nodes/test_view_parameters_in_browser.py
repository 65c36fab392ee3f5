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

"""The parameters of real detectors on the page of a real slip_view, in a real browser."""

import asyncio
import re
import signal
from concurrent.futures import ThreadPoolExecutor

import pytest

from slip_detector.nodes.view_parameters import ParameterClient
from slip_detector.parameters.detector import DetectorConfig
from support.browsers import PATIENCE_MS, expect

FILE = """
/**/slip_driver: {ros__parameters: {source: udp}}
/**/slip_detector: {ros__parameters: {threshold: 0.25, channels: 3, vote: mean}}
"""


@pytest.fixture
def opened(bench, browser, tmp_path):
    """Return what opens pages of one slip_view, with the parameters shown."""
    file = tmp_path / 'given.yaml'
    file.write_text(FILE, encoding='utf-8')
    words = ('--port', '0', '--folder', str(tmp_path / 'saved'), '--config', str(file))
    view = bench.start_python('-m', 'slip_detector.nodes.view', *words)
    bench.wait_for(lambda: 'http://' in view.log(), 'the address')
    address = re.search(r'http://\S+', view.log()).group()
    pages = []

    def open_():
        pages.append(browser.new_page())
        pages[-1].goto(address)
        pages[-1].get_by_role('tab', name='Parameters').click(timeout=PATIENCE_MS)
        expect(field(pages[-1], 'threshold')).to_have_value('0.25')
        return pages[-1]

    yield open_
    for page in pages:
        page.close()


def started(bench, tmp_path, *words, file='given.yaml'):
    return bench.start('slip_detector', '--params-file', str(tmp_path / file), *words)


def field(page, name):
    return page.locator(f'[data-name="{name}"] :is(input, select)')


def button(page, name):
    return page.locator('#tools').get_by_role('button', name=name)


def set_value(page, name, text):
    field(page, name).fill(text)
    field(page, name).press('Enter')


def changes(page):
    return page.locator('#parameters .changes')


def test_what_one_changes_all_see_and_what_is_saved_starts_a_detector_that_is_equal(
    bench, opened, tmp_path
):
    started(bench, tmp_path, '-r', '__ns:=/thumb')
    one, other = opened(), opened()
    field(one, 'gain').fill('7')
    set_value(one, 'threshold', 'low')
    refusal = one.locator('#parameters [role=alert]')
    expect(refusal).to_have_text("Refused: parameter threshold is 'low', allowed: a number")
    set_value(one, 'threshold', '0.125')
    expect(field(other, 'gain')).to_have_value('7')
    expect(changes(one)).to_have_text('Set: gain from 100 to 7, threshold from 0.25 to 0.125.')
    expect(changes(other)).to_contain_text('Changed on another page: ')
    # Somebody at a command line.
    client = ParameterClient(bench.node, '/thumb/slip_detector')
    assert run(client.set({'threshold': 0.75, 'stopbands_hz': []})) == ''
    for page in (one, other):
        last = changes(page).locator('li').last
        expect(last).to_contain_text('Changed by another program: threshold from 0.125 to 0.75')
    button(other, 'Undo').click()
    expect(field(one, 'stopbands_hz')).to_have_value('0.5, 7, 50, 180')
    button(one, 'Save').click()
    expect(one.locator('#tools .saved')).to_contain_text(f'config:={tmp_path}/saved/thumb')
    before = run(client.read()).values
    started(bench, tmp_path, '-r', '__ns:=/index', file='saved/thumb.yaml')
    again = ParameterClient(bench.node, '/index/slip_detector')
    bench.wait_for(lambda: bench.node.count_publishers('/index/slip_valid'), 'the other detector')
    assert run(again.read()).values == before
    config = DetectorConfig.from_yaml(tmp_path / 'saved' / 'thumb.yaml')
    assert (config.threshold, config.gain, config.vote) == (0.125, 7.0, 'mean')
    button(one, 'As in the file').click()
    expect(field(other, 'threshold')).to_have_value('0.25')
    expect(field(other, 'gain')).to_have_value('100')
    for each in (client, again):
        each.destroy()


def run(asked):
    """Wait for what is asked of a detector; a browser's event loop runs in this thread."""
    with ThreadPoolExecutor() as thread:
        return thread.submit(asyncio.run, asked).result()


def test_a_detector_that_dies_and_comes_again_is_told_and_what_was_changed_can_be_set_again(
    bench, opened, tmp_path
):
    process = started(bench, tmp_path)
    page = opened()
    set_value(page, 'threshold', '0.125')
    expect(changes(page)).to_contain_text('Set: ')
    process.signal(signal.SIGSTOP)
    set_value(page, 'threshold', '0.5')
    refusal = page.locator('#parameters [role=alert]')
    expect(refusal).to_have_text(
        'Refused: nothing was changed: /slip_detector has not answered for 5 s', timeout=20_000
    )
    expect(field(page, 'threshold')).to_have_value('0.5')
    process.signal(signal.SIGKILL)
    process.wait()
    # See Bench.wait_until_forgotten.
    expect(page.get_by_text('slip_detector: its detector has ended.')).to_be_visible()
    started(bench, tmp_path)
    expect(changes(page).locator('li').last).to_have_text(
        'The detector was started again, with: threshold from 0.125 to 0.25.'
    )
    button(page, 'Discard').click()
    button(page, 'Undo').click()
    expect(field(page, 'threshold')).to_have_value('0.125')
    expect(changes(page).locator('li').last).to_contain_text('Set: threshold from 0.25 to 0.125.')
