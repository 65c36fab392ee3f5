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

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.parameters.detector import ChainConfig
from slip_detector.report import page as report
from slip_detector.report.page_data import SearchTrial, Variant
from slip_detector.report.page_sections import UNDEFINED
from support import report_scenes as scenes
from support.html_page import HtmlPage


def read(path):
    return HtmlPage(path.read_text(encoding='utf-8'))


@pytest.fixture(scope='module')
def path_of_page(tmp_path_factory, variants):
    path = tmp_path_factory.mktemp('report') / 'report.html'
    report.write_page(path, 'A title', variants, scenes.trials(), ['A note.'])
    return path


@pytest.fixture(scope='module')
def page(path_of_page):
    return read(path_of_page)


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


HARD = [
    '</script>',
    '<img src=x onerror=alert(1)>',
    '$title',
    '&lt;',
    '\'"`${1}',
    '$a_$',
    '\u6ed1',
]


# What takes the time are the two pictures of an example, which names all its texts.
@settings(max_examples=3)
@given(st.lists(st.tuples(st.text(max_size=40), st.sampled_from(HARD)), min_size=3, max_size=3))
def test_any_text_is_shown_as_it_is(tmp_path_factory, texts):
    # With a number, so that none is another's or a part of it.
    names = [
        f'{text.encode("utf-8", "replace").decode()}{k}{hard}'
        for k, (text, hard) in enumerate(texts)
    ]
    volts, truth = scenes.volts_and_truth(40)
    # The first is the name of the recording and the title too.
    seen = scenes.overview(names[0], scenes.GIVEN, volts, truth)
    variants = [Variant(name, scenes.GIVEN, [seen], {name: {name: name}}) for name in names]
    trials = [
        SearchTrial(k, 0.1, 1.0, 0.0, 1.0, {name: name}, name) for k, name in enumerate(names)
    ]
    path = tmp_path_factory.mktemp('text') / 'report.html'
    report.write_page(path, names[0], variants, trials, names)
    shown = read(path)
    assert shown.header['recordings'][0]['name'] == names[0]
    assert shown.header['variants'] == names
    together = ' '.join(''.join(shown.texts).split())
    for name in names:
        normal = ' '.join(name.replace('\0', '\N{REPLACEMENT CHARACTER}').split())
        assert together.count(normal) >= 4
    assert not [tag for tag, attributes in shown.tags if 'onerror' in attributes]


def test_events_are_in_the_header(page):
    events = page.header['recordings'][1]['variants'][0]['events']
    assert events[0] == [0, 2.0, 2.2, None, {}, '']
    assert events[2] == [1, 9.0, 10.0, None, {}, 'lost at: vote']
    assert events[3] == [2, 15.0, 16.0, 0.4, {'filter': 0.012, 'vote': 0.388}, '']


def test_the_same_report_is_the_same_bytes(path_of_page, tmp_path, variants):
    again = tmp_path / 'again.html'
    report.write_page(again, 'A title', variants, scenes.trials(), ['A note.'])
    assert again.read_bytes() == path_of_page.read_bytes()


def test_pictures_hold_the_same_figures(tmp_path, variants):
    paths = report.write_pictures(tmp_path / 'out', variants, scenes.trials())
    assert [path.name for path in paths] == [
        'timeline_1_a.npz.png', 'timeline_2_b.npz.png', 'filters.png', 'front.png', 'figures.txt',
    ]  # fmt: skip
    for path in paths[:-1]:
        assert path.read_bytes().startswith(b'\x89PNG')
    text = paths[-1].read_text(encoding='utf-8')
    assert re.search(rf'latency median \[ms\] +34.6 +{UNDEFINED}\n', text)
    given = variants[0]._replace(overviews=variants[0].overviews[:1])
    assert [path.name for path in report.write_pictures(tmp_path / 'one', [given])] == [
        'timeline_a.npz.png', 'filters.png', 'figures.txt',
    ]  # fmt: skip


@pytest.mark.parametrize('channels', [1, 96])
def test_few_and_many_channels_without_labels(tmp_path, channels):
    config = ChainConfig(channels=channels, disabled_channels=(2,) if channels > 1 else ())
    volts, _ = scenes.volts_and_truth(500, channels)
    variant = Variant('given', config, [scenes.overview('a', config, volts, None)], {})
    report.write_page(tmp_path / 'report.html', 'A title', [variant])
    (recording,) = read(tmp_path / 'report.html').header['recordings']
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
