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

"""Parts of the live page, as tests find them, each by a locator of one element; and their use."""

import re

NAME = '/index/slip_detector'


def card(page, label='index'):
    """Return the card of a finger."""
    return page.locator(f'[data-finger="/{label}/slip_detector"]')


def field(page, name):
    """Return the field of a parameter."""
    return page.locator(f'[data-name="{name}"] :is(input, select)')


def tool(page, name):
    """Return the button below "Set up" that has just this name."""
    return page.locator('#tools').get_by_role('button', name=name, exact=True)


def button(page, name):
    return page.get_by_role('button', name=name, exact=True)


def slider(page, name):
    return page.get_by_role('slider', name=name, exact=True)


def tab(page, name):
    return page.get_by_role('tab', name=name, exact=True)


def record_button(page, word):
    """Return the button that records "Rest", "Slip" or "Taps"; its name has a count, too."""
    return page.locator('.teach-buttons').get_by_role('button', name=re.compile(rf'^{word}\b'))


def changes(page):
    """Return the list of the parameters' changes."""
    return page.locator('#parameters .changes')


def threshold_line(page):
    return slider(page, 'Threshold')


def mains(page):
    """Return the choice of the frequency of the mains."""
    return page.get_by_label('Hum of the mains that is taken off', exact=True)


def recording_now(page):
    """Return the line that tells what is recorded now."""
    return page.locator('.teach-now')


def recording(page, name):
    """Return the row of a recording in the list."""
    return page.get_by_role('row', name=re.compile(rf'^{name}\b'))


def config_of(served, name=NAME):
    """Return the configuration with which a simulated detector runs."""
    return served.call(lambda: served.detectors.fingers[name].config)


def press(place, *keys):
    """Press keys, one after the other, on an element."""
    for key in keys:
        place.press(key)


def until(page, condition):
    """Wait until something holds of the data of the timeline."""
    data = 'const data = document.getElementById("timeline").dataset;'
    page.wait_for_function(f'() => {{ {data} return {condition}; }}', timeout=60_000)
