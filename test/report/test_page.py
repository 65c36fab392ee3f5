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

"""Reports: what is in the file. How it behaves in a browser is in test_page_in_browser.py."""

import dataclasses
import json
import re
from html.parser import HTMLParser

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.parameters.detector import ChainConfig
from slip_detector.report import page as report
from slip_detector.report import page_pictures
from slip_detector.report.page_data import SearchTrial, Variant
from support import report_scenes as scenes


class Page(HTMLParser):
    """Tags, texts and the contents of scripts, as a browser would take them apart."""

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


@pytest.fixture(scope='module')
def variants():
    return scenes.variants()


@pytest.fixture
def undrawn(monkeypatch):
    """Leave the pictures out, for tests that look at words and numbers."""
    monkeypatch.setattr(page_pictures, 'svg', lambda figure: '')


@pytest.fixture(scope='module')
def page(tmp_path_factory, variants):
    path = tmp_path_factory.mktemp('report') / 'report.html'
    report.write_page(path, 'A title', variants, scenes.trials(), ['A note.'])
    return Page(path)


def test_nothing_is_fetched_from_anywhere(page):
    for tag, attributes in page.tags:
        assert tag not in ('link', 'iframe', 'object', 'embed')
        assert not (tag == 'script' and 'src' in attributes)
        if tag == 'img':
            assert attributes['src'].startswith('data:')
            assert attributes['alt']
    (policy,) = [a['content'] for t, a in page.tags if t == 'meta' and 'http-equiv' in a]
    assert policy.startswith("default-src 'none';")
    # A comment may say where the library is from.
    code = re.sub(r'/\*.*?\*/', '', page.scripts['code'], flags=re.DOTALL)
    assert not re.search(r'https?://', code)


@settings(max_examples=6)
@given(
    st.text(max_size=40),
    st.sampled_from(
        [
            '</script>',
            '<img src=x onerror=alert(1)>',
            '$title',
            '&lt;',
            '\'"`${1}',
            '$a_$',
            '\u6ed1',
        ]
    ),
)
def test_any_text_is_shown_as_it_is(tmp_path_factory, text, hard):
    words = text.encode('utf-8', 'replace').decode() + hard
    volts, truth = scenes.volts_and_truth(40)
    seen = scenes.overview(words, scenes.GIVEN, volts, truth)
    path = tmp_path_factory.mktemp('text') / 'report.html'
    variant = Variant(words, scenes.GIVEN, [seen], {words: {words: words}})
    report.write_page(
        path,
        words,
        [variant],
        [SearchTrial(0, 0.1, 1.0, 0.0, 1.0, {words: words}, words)],
        [words],
    )
    shown = Page(path)
    assert shown.header['recordings'][0]['name'] == words
    assert shown.header['variants'] == [words]
    normal = ' '.join(words.replace('\0', '\N{REPLACEMENT CHARACTER}').split())
    texts = ' '.join(''.join(shown.texts).split())
    assert texts.count(normal) >= 4
    assert not [tag for tag, attributes in shown.tags if 'onerror' in attributes]


def test_events_are_in_the_header(page):
    events = page.header['recordings'][1]['variants'][0]['events']
    assert events[0] == [0, 2.0, 2.2, None, {}, '']
    assert events[2] == [1, 9.0, 10.0, None, {}, 'lost at: vote']
    assert events[3] == [2, 15.0, 16.0, 0.4, {'filter': 0.012, 'vote': 0.388}, '']


def test_figures_are_in_the_table_and_what_is_undefined_is_said_to_be(page):
    text = '|'.join(text for text in page.texts if text.strip())
    assert 'latency median [ms]' in text
    assert '|a.npz|given|3|1|34.6|' in text
    assert f'|tuned|3|0|{report.UNDEFINED}|' in text
    assert f'{report.UNDEFINED}: not defined' in text


@pytest.mark.usefixtures('undrawn')
def test_without_trials_there_is_no_front(tmp_path, page, variants):
    assert any('5 trials. 3 of them are on the front' in text for text in page.texts)
    assert any('1 are not drawn' in text for text in page.texts)
    report.write_page(tmp_path / 'report.html', 'A title', variants[:1])
    assert 'Trade-off' not in Page(tmp_path / 'report.html').texts


def test_parameters_that_differ_are_shown_first(page):
    text = '|'.join(text for text in page.texts if text.strip())
    assert '|passband_hz|7 50|10 60|' in text
    assert text.index('|vote|all|mean|') < text.index('All parameters') < text.index('|channels|')


@pytest.mark.usefixtures('undrawn')
def test_the_floors_of_many_channels_have_a_table_of_their_own(tmp_path):
    floors = tuple(1e-4 * (k + 1) for k in range(16))
    each = dataclasses.replace(scenes.EVIDENCE, noise_floor=floors)
    swapped = dataclasses.replace(
        each, noise_floor=(floors[0], *floors[2:15], floors[1], floors[15])
    )
    volts, truth = scenes.volts_and_truth(800)
    variants = [
        Variant(name, config, [scenes.overview('a.npz', config, volts, truth)], {})
        for name, config in (('given', each), ('tuned', swapped), ('paper', scenes.GIVEN))
    ]
    report.write_page(tmp_path / 'report.html', 'A title', variants[:2])
    text = '|'.join(text for text in Page(tmp_path / 'report.html').texts if text.strip())
    shown = '16 numbers, 0.0001 to 0.0016'
    differing = text.index(f'|noise_floor|{shown}|{shown}|')
    assert differing < text.index('|All parameters|')
    assert (
        '|noise_floor of each channel|channel|given|tuned|ch1|0.0001|0.0001|ch2|0.0002|0.0003|'
        in text
    )
    report.write_page(tmp_path / 'report.html', 'A title', variants[::2])
    text = '|'.join(text for text in Page(tmp_path / 'report.html').texts if text.strip())
    assert f'|ch16|0.0016|{report.UNDEFINED}' in text
    report.write_page(tmp_path / 'report.html', 'A title', variants[2:])
    assert 'noise_floor of each channel' not in Page(tmp_path / 'report.html').texts


def test_the_same_report_is_the_same_bytes(tmp_path, variants):
    for name in ('one.html', 'two.html'):
        report.write_page(tmp_path / name, 'A title', variants, scenes.trials())
    assert (tmp_path / 'one.html').read_bytes() == (tmp_path / 'two.html').read_bytes()


def test_pictures_hold_the_same_figures(tmp_path, variants):
    paths = report.write_pictures(tmp_path / 'out', variants, scenes.trials())
    assert [path.name for path in paths] == [
        'timeline_1_a.npz.png', 'timeline_2_b.npz.png', 'filters.png', 'front.png', 'figures.txt',
    ]  # fmt: skip
    for path in paths[:-1]:
        assert path.read_bytes().startswith(b'\x89PNG')
    text = paths[-1].read_text(encoding='utf-8')
    assert re.search(rf'latency median \[ms\] +34.6 +{report.UNDEFINED}\n', text)
    assert [p.name for p in report.write_pictures(tmp_path / 'one', variants[:1])][-2:] == [
        'filters.png', 'figures.txt',
    ]  # fmt: skip


@pytest.mark.parametrize('channels', [1, 96])
def test_few_and_many_channels_without_labels(tmp_path, channels):
    config = ChainConfig(channels=channels, disabled_channels=(2,) if channels > 1 else ())
    volts, _ = scenes.volts_and_truth(500, channels)
    variant = Variant('given', config, [scenes.overview('a', config, volts, None)], {})
    report.write_page(tmp_path / 'report.html', 'A title', [variant])
    (recording,) = Page(tmp_path / 'report.html').header['recordings']
    assert recording['truth'] is None
    assert len(recording['channels']) == channels
    assert len(report.write_pictures(tmp_path, [variant])) == 3


def test_variants_must_show_the_same_recordings(tmp_path, variants):
    other = variants[1]._replace(overviews=variants[1].overviews[:1])
    with pytest.raises(
        ValueError, match=r'tuned: shows a.npz, allowed: the same for all variants'
    ):
        report.write_page(tmp_path / 'report.html', 'A title', [variants[0], other])
    nothing = variants[0]._replace(overviews=[])
    with pytest.raises(ValueError, match='given: shows no recording'):
        report.write_page(tmp_path / 'report.html', 'A title', [nothing])


@pytest.mark.usefixtures('undrawn')
def test_what_cannot_be_written_is_one_line(tmp_path, variants):
    with pytest.raises(ValueError, match=r'no/report.html: cannot be written \(No such file'):
        report.write_page(tmp_path / 'no' / 'report.html', 'A title', variants[:1])
    (tmp_path / 'file').write_text('')
    with pytest.raises(ValueError, match=r'file/out: cannot be made \(Not a directory'):
        report.write_pictures(tmp_path / 'file' / 'out', variants[:1])
