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


"""An old bag is played on the page by real nodes, and labelled there by hands that are late."""

import re

import numpy as np
import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.yaml_files import read_yaml
from slip_detector.recordings import write_recording
from slip_detector.recordings.labels import read_labels
from slip_detector.scenes import find_scene
from support import page_parts as parts
from support.browsers import PATIENCE_MS, complaints_of, expect
from support.training import samples

#: The hand is so late, in seconds, at the start and at the end of a slip.
LATE_S = 0.2, 0.15


def test_a_bag_is_played_and_labelled_by_key_and_pointer(bench, browser, tmp_path):
    # Two plates that slide once each, one after the other.
    plate = read_yaml(find_scene('plate_400um'))
    one, other = (samples(plate, 9.6, seed=seed) for seed in (3, 4))
    step_ns = one.stamps_ns[1] + one.stamps_ns[-1]
    rows = one.then(other._replace(stamps_ns=other.stamps_ns + step_ns))
    path, file = tmp_path / 'old.mcap', tmp_path / 'old.labels.yaml'
    bare = rows._replace(truth=None, position_m=None, stamps_ns=rows.stamps_ns + 10**18)
    write_recording(path, [bare], 380.0, DetectorConfig().names)
    edges = np.flatnonzero(np.diff(rows.truth))
    slips_s = np.reshape(rows.stamps_ns[edges] * 1e-9, (-1, 2))
    view, address = bench.start_view('--bag', str(path), '--folder', str(tmp_path / 'taught'))
    page = browser.new_page()
    page.set_default_timeout(PATIENCE_MS)
    complaints = complaints_of(page, address)
    page.goto(address)
    words, where = page.locator('#played .hint'), page.locator('#bag-where')
    expect(words).to_have_text(
        re.compile(r'Labels: 0, in .*old\.labels\.yaml\. ON for .* of the recording')
    )

    # What is read is drawn before the detector has started.
    expect(page.locator('.finger')).to_be_visible()

    def wait_for(seconds):
        """Wait for a place, and return it as it is shown."""
        while (shown := float(where.inner_text().split()[0])) < seconds:
            assert not view.ended(), view.log()
            page.wait_for_timeout(5)
        return shown

    box = page.locator('#played .trace').bounding_box()
    duration_s = float(re.search(r'of ([\d.]+)', where.inner_text())[1])

    def pixel(seconds):
        return box['x'] + seconds / duration_s * box['width'], box['y'] + box['height'] / 2

    # To just before the first slip, which the finger shows and the hand marks.
    page.mouse.click(*pixel(slips_s[0, 0] - 1.0))
    page.locator('#bag-speed').select_option('0.5')
    wait_for(slips_s[0, 0] + LATE_S[0])
    page.keyboard.down('l')
    expect(page.locator('.finger')).to_have_attribute('data-state', 'slip')
    wait_for(slips_s[0, 1] + LATE_S[1])
    page.keyboard.up('l')
    expect(words).to_contain_text('Labels: 1')
    first = read_labels(file)
    assert first.accuracy_s == 0.35 * 0.5
    assert first.edges_s == pytest.approx(slips_s[:1] + LATE_S, abs=0.3)

    parts.button(page, 'Stop').click()
    page.mouse.move(*pixel(slips_s[1, 0] + 0.3))
    page.mouse.down()
    page.mouse.move(*pixel(slips_s[1, 0] + 0.8))
    page.mouse.move(*pixel(slips_s[1, 1] + 0.1))
    page.mouse.up()
    expect(words).to_contain_text('Labels: 2')
    end = parts.slider(page, 'End of the slip in recording').last
    dragged = read_labels(file).edges_s[1, 1]
    end.focus()
    page.keyboard.press('PageUp')
    page.keyboard.press('Enter')
    bench.wait_for(lambda: read_labels(file).edges_s[1, 1] != dragged, 'the end to be kept')
    parts.button(page, 'Snap recording').click()
    bench.wait_for(lambda: read_labels(file).accuracy_s == 0.1, 'the ends to be snapped')
    kept = read_labels(file)
    assert kept.edges_s == pytest.approx(slips_s, abs=0.05)

    # Without a pointer.
    page.locator('#bag-place').press('Home')
    expect(where).to_have_text(re.compile(r'^0\.0 of'))
    # A third one by mistake is taken back, or deleted.
    page.mouse.move(*pixel(1.0))
    page.mouse.down()
    page.mouse.move(*pixel(2.0))
    page.mouse.up()
    expect(words).to_contain_text('Labels: 3')
    page.mouse.click(*pixel(1.5))
    expect(where).to_have_text(re.compile(r'^1\.[3-7] of'))
    parts.button(page, 'Delete label').click()
    expect(words).to_contain_text('Labels: 2')
    assert read_labels(file).edges_s.tolist() == kept.edges_s.tolist()
    file.unlink()
    file.mkdir()
    parts.button(page, 'Undo recording').click()
    expect(words).to_contain_text('Refused: ')
    page.close()
    assert complaints == []
    assert 'Traceback' not in view.log()
