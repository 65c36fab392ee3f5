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


"""What is in sight on the page, on a laptop, an older one and a phone."""

import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.tuning import TuneRun
from support.browsers import expect
from support.finger_states import rest_rows
from support.page_parts import NAME, tool

#: Width and height of windows.
LAPTOP, OLD_LAPTOP, PHONE = (1440, 900), (1024, 768), (390, 844)


def resize(page, size):
    page.set_viewport_size(dict(zip(('width', 'height'), size, strict=True)))


def tuned(served):
    """Let the tuning of the finger have found something."""
    run = TuneRun.__new__(TuneRun)
    vars(run).update(
        _config=DetectorConfig(), found=DetectorConfig(threshold=0.25), held_out=[], lines=[],
        table=[('recall', '0.8', '0.9', 'better')], running=False, stopping=False, step='',
        failed='', share=1.0,
    )  # fmt: skip
    apply, _ = served.server.requests['apply_tuning']
    vars(apply.__self__).update(_run=run, _tuned_finger=NAME)


def click_at_the_edge(page, name):
    """Click a button that stands at the lower edge of the window; return it."""
    button = tool(page, name)
    button.evaluate('button => button.scrollIntoView({block: "end"})')
    button.click()
    return button


def expect_beside(button, answer, words):
    expect(answer).to_contain_text(words)
    expect(answer).to_be_in_viewport(ratio=1)
    expect(button).to_be_in_viewport()
    asked, told = button.bounding_box(), answer.bounding_box()
    assert abs(told['y'] - asked['y']) < 60


@pytest.mark.parametrize('size', [LAPTOP, PHONE], ids=['laptop', 'phone'])
def test_an_answer_stands_beside_its_button_in_sight(played, size):
    served, page = played({'index': rest_rows()})
    resize(page, size)
    saved = page.locator('#saved')
    expect_beside(click_at_the_edge(page, 'Save'), saved, 'Saved. ros2 launch')
    expect_beside(click_at_the_edge(page, 'Save'), saved, 'already exists')
    expect(tool(page, 'Replace the file')).to_be_in_viewport(ratio=1)
    served.call(tuned, served)
    expect(tool(page, 'Apply 1 values')).to_be_enabled()
    words, refusal = page.locator('.teach-words'), page.locator('#teach .refusal:visible')
    expect_beside(click_at_the_edge(page, 'Apply 1 values'), words, '1 values set')
    finger = served.detectors.fingers[NAME]
    served.call(finger.update_config, DetectorConfig(sample_rate_hz=400.0))
    expect_beside(click_at_the_edge(page, 'Apply 1 values'), refusal, 'tune it again')
