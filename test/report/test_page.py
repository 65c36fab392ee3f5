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

"""What is in the file of a report; how it behaves in a browser is in test_page_in_browser.py."""

import base64
import dataclasses
import functools
import json
import re
import zlib
from html.parser import HTMLParser

import numpy as np
import pytest
from report import report_scenes as scenes

from slip_detector.commands.evaluate import as_report
from slip_detector.evaluation.evaluator import RecordingLoader, evaluate_recording
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.report import page as report
from slip_detector.report.overview import OUTCOMES, overview_of
from slip_detector.report.page import Variant
from support import tuning_cases

OBSERVE = functools.partial(overview_of, scenes.GIVEN, 0.5)


@pytest.fixture(scope='module')
def variants():
    """The two variants of a report of two recordings."""
    return scenes.variants()


class HtmlPage(HTMLParser):
    """Tags, texts and the contents of scripts of a file, as a browser would take them apart."""

    def __init__(self, path):
        super().__init__()
        self.tags, self.texts, self.scripts, self._script = [], [], {}, None
        self.feed(path.read_text(encoding='utf-8'))

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self._script = dict(attributes).get('id', 'code') if tag == 'script' else None

    def handle_endtag(self, tag):
        self._script = None

    def handle_data(self, data):
        if self._script is not None:
            self.scripts[self._script] = self.scripts.get(self._script, '') + data
        else:
            self.texts.append(data)

    @property
    def header(self):
        return json.loads(self.scripts['header'])


def text_of(path):
    """Return what is read, with a stroke between two cells."""
    return '|'.join(text for text in HtmlPage(path).texts if text.strip())


def test_a_page_may_fetch_nothing_and_is_the_same_bytes_again(tmp_path, variants):
    pages = [tmp_path / name for name in ('one.html', 'other.html')]
    for path in pages:
        report.write_page(path, 'A title', variants, ['A note.'])
    assert len({re.sub(r'[\d-]+ [\d:]+ UTC', '', path.read_text()) for path in pages}) == 1
    page = HtmlPage(pages[0])
    (policy,) = [a['content'] for t, a in page.tags if t == 'meta' and 'http-equiv' in a]
    assert policy.startswith("default-src 'none';")
    events = page.header['recordings'][1]['variants'][0]['events']
    assert events[0] == [1, 2.0, 2.2, None, {}, '']
    assert events[3] == [2, 15.0, 16.0, 0.4, {'filter': 0.012, 'vote': 0.388}, '']


HARD = ('</script>', '<img src=x onerror=alert(1)>', '$title', '&lt;', '\'"`${1}', '\ud800')


def test_any_text_is_shown_as_it_is(tmp_path):
    # With a number, so that none is another's or a part of it.
    names = [f'{k} {hard}' for k, hard in enumerate(HARD)]
    # The first is the name of the recording and the title too.
    seen = scenes.overview(names[0], scenes.GIVEN, *scenes.volts_and_truth(40))
    given_ = Variant('given', [seen], {name: {'slips': 1} for name in names})
    path = tmp_path / 'report.html'
    report.write_page(path, names[0], [given_], names)
    shown = HtmlPage(path)
    assert shown.header['recordings'][0]['name'] == names[0]
    together = ' '.join(''.join(shown.texts).split())
    for name in names:
        assert together.count(name.replace('\ud800', '\\ud800')) >= 3
    assert not [tag for tag, attributes in shown.tags if 'onerror' in attributes]


@pytest.mark.parametrize('most_cells', [2**20, 16 * 256])
def test_the_data_are_the_overviews(monkeypatch, most_cells):
    monkeypatch.setattr('slip_detector.report.overview.MOST_CELLS', most_cells)
    volts, truth = scenes.volts_and_truth()
    volts[:, 3] = volts[100:200, 5] = np.nan
    overviews = [
        scenes.overview('a', config, volts, truth, scenes.EVENTS['given'])
        for config in (scenes.GIVEN, scenes.TUNED)
    ]
    header = report.pack_recording(overviews)
    bytes_ = np.frombuffer(zlib.decompress(base64.b64decode(header['data'])), np.uint8)
    lowest, step = np.array(header['lowest_v']), np.array(header['step_v'])
    first, bins = overviews[0], header['bins']
    assert (bins, header['bin_rows']) == (len(first.low), first.bin_rows)
    assert header['truth'] == first.truth.edges
    columns = iter(bytes_.reshape(-1, 16, bins).transpose(0, 2, 1))
    for expected in (first.low, first.high)[: min(first.bin_rows, 2)]:
        codes = next(columns) + 256 * next(columns).astype(int)
        found = np.where(codes == report.NO_SAMPLE, np.nan, lowest + step * codes)
        np.testing.assert_allclose(found, expected, rtol=0, atol=0.51 * step.max())
    for overview, variant in zip(overviews, header['variants'], strict=True):
        np.testing.assert_array_equal(next(columns), overview.codes)
        assert variant['slip'] == overview.slip.edges
        assert [group['on'] for group in variant['groups']] == [
            on.edges for on in overview.groups.values()
        ]
    assert not [*columns]


def evaluation_of(folder, *names, **labels):
    """Return the evaluation of a recording of each name, and the page that reports all."""
    sets = {}
    for name in names:
        path = folder / f'{name}.npz'
        np.savez(path, volts=scenes.volts_and_truth()[0], sample_rate_hz=380.0, **labels)
        evaluated = evaluate_recording(RecordingLoader(scenes.GIVEN), path, OBSERVE)
        sets[name] = {'a.npz': evaluated}
    report.write_evaluation_report(folder / 'page.html', sets, as_report(sets))
    return evaluated, HtmlPage(folder / 'page.html')


def test_the_report_of_an_evaluation_names_sets_and_has_events(tmp_path):
    _, page = evaluation_of(tmp_path, 'x', 'y', slip=scenes.volts_and_truth()[1])
    for name, recording in zip(('x/a.npz', 'y/a.npz'), page.header['recordings'], strict=True):
        assert recording['name'] == name
        slips = [event for event in recording['variants'][0]['events'] if event[0] != 1]
        assert len(slips) == len(scenes.SLIPS_S)
    assert {'all recordings', 'x/a.npz'} <= set(page.texts)


def test_the_report_of_a_recording_without_labels_has_its_onsets_and_how_to_label_it(tmp_path):
    one, page = evaluation_of(tmp_path, 'x')
    (recording,) = page.header['recordings']
    assert recording['truth'] is None
    onset = OUTCOMES.index('onset')
    events = [tuple(event[:3]) for event in recording['variants'][0]['events']]
    assert events == [(onset, *on_s) for on_s in one.outcome.on_s]
    assert one.outcome.on_s
    # Of one recording there is no row for all.
    assert 'all recordings' not in page.texts
    assert any(text.startswith('a.npz: no labels; scores need slip_s: ') for text in page.texts)


def test_a_chain_of_a_search_is_replayed_on_all_recordings():
    held, tuned_on = (tuning_cases.track(seed, duration_s=6.0) for seed in (10, 1))
    names = tuple(f'L{k}' for k in range(held.volts.shape[1]))
    held = dataclasses.replace(held, samples=held.samples._replace(names=names))
    parts = {'held out': [held], 'tuned on': [tuned_on]}
    given = report.replay_variant('given', Replay(tuning_cases.CHAIN), parts)
    for overview in given.overviews:
        slips = [event for event in overview.events if event.outcome != 'false alarm']
        assert len(slips) == 2
    default = tuning_cases.CHAIN.names
    assert [one.channel_names for one in given.overviews] == [default, names]
    figures = given.figures['all tuned on']
    assert figures == given.figures['seed 1 (tuned on)'] != given.figures['all held out']
    assert set(figures) == set(figures_of_merit([]))


def test_figures_and_differing_parameters_are_in_tables(tmp_path, variants):
    report.write_page(tmp_path / 'both.html', '', variants)
    report.write_page(tmp_path / 'tuned.html', '', variants[1:])
    text, tuned = (text_of(tmp_path / name) for name in ('both.html', 'tuned.html'))
    assert '|a.npz, given|3|' in text
    assert text.index('|missed|1|0|') < text.index('|recording|') < text.index('All figures')
    assert '|passband_hz|7 50|7 50|10 60|' in text
    assert text.index('|all|mean|') < text.index('All parameters') < text.index('|channels|')
    assert '|parameter|default|tuned|passband_hz|7 50|10 60|' in tuned
