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

"""The sections of a report below its timeline, without their pictures."""

import dataclasses

import pytest

from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.page_data import Variant
from slip_detector.report.page_sections import UNDEFINED, figures_text, sections
from support import report_scenes as scenes
from support.html_page import HtmlPage

FLOORS = tuple(1e-4 * (k + 1) for k in range(16))

#: Two of them are the other way round.
SWAPPED = (FLOORS[0], FLOORS[2], FLOORS[1], *FLOORS[3:])


pytestmark = pytest.mark.usefixtures('undrawn')


def text_of(variants, trials=()):
    """Return what is read, with a stroke between two cells."""
    page = HtmlPage(''.join(sections(variants, trials)))
    return '|'.join(text for text in page.texts if text.strip())


def by_evidence(name, floors):
    config = dataclasses.replace(scenes.EVIDENCE, noise_floor=floors)
    return shown(name, config)


def shown(name, config):
    return Variant(
        name, config, [scenes.overview('a.npz', config, *scenes.volts_and_truth(800))], {}
    )


def test_figures_are_in_the_table_and_what_is_undefined_is_said_to_be(variants):
    text = text_of(variants)
    assert 'latency median [ms]' in text
    assert '|a.npz|given|3|1|34.6|' in text
    assert f'|tuned|3|0|{UNDEFINED}|' in text
    assert f'{UNDEFINED}: not defined' in text


def test_the_trials_on_the_front_are_told_where_there_was_a_search(variants):
    text = text_of(variants, scenes.trials())
    assert '|5 trials. 3 of them are on the front' in text
    assert ' 1 are not drawn' in text
    assert 'Trade-off' not in text_of(variants)


def test_parameters_that_differ_are_shown_first(variants):
    text = text_of(variants)
    assert '|passband_hz|7 50|10 60|' in text
    assert text.index('|vote|all|mean|') < text.index('All parameters') < text.index('|channels|')


def test_equal_configurations_are_said_to_be_equal(variants):
    text = text_of([variants[0], variants[0]._replace(name='again')])
    assert '|Parameters|All equal.|All parameters|' in text


def test_the_floors_of_many_channels_have_a_table_of_their_own():
    given, swapped = by_evidence('given', FLOORS), by_evidence('tuned', SWAPPED)
    text = text_of([given, swapped])
    told = '16 numbers, 0.0001 to 0.0016'
    assert text.index(f'|noise_floor|{told}|{told}|') < text.index('|All parameters|')
    table = '|noise_floor of each channel|channel|given|tuned|ch1|0.0001|0.0001|ch2|0.0002|0.0003|'
    assert table in text
    paper = shown('paper', scenes.GIVEN)
    assert f'|ch16|0.0016|{UNDEFINED}' in text_of([given, paper])
    assert 'noise_floor of each channel' not in text_of([paper])


def test_as_text_there_is_a_block_for_each_recording():
    config, figures = ChainConfig(), {'slips': 3, 'auc_all': None}
    pair = [Variant(name, config, [], {'a.npz': figures}) for name in ('given', 'tuned')]
    lines = figures_text(pair).splitlines()
    assert [line.split() for line in lines[:3]] == [
        ['a.npz', 'given', 'tuned'],
        ['slips', '3', '3'],
        ['AUC', 'all', UNDEFINED, UNDEFINED],
    ]
    assert lines[-1] == f'{UNDEFINED}: not defined'
