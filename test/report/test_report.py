"""Reports: what is in the file. How it behaves in a browser is in test_report_browser.py."""

import base64
import json
import re
import zlib
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.parameters.detector import ChainConfig
from slip_detector.report import page as report
from slip_detector.report import page_data as report_data
from slip_detector.report.page_data import SearchTrial, Variant, trade_off_front
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


@pytest.fixture(scope='module')
def page(tmp_path_factory, variants):
    path = tmp_path_factory.mktemp('report') / 'report.html'
    report.write_page(path, 'A title', variants, scenes.trials(), ['A note.'])
    return Page(path)


def unplaned(data, n, size):
    """Return n numbers of which all lowest bytes come first; and what is left of the data."""
    planes = np.frombuffer(data[: n * size], np.uint8).reshape(size, n).astype(np.uint64)
    factors = 256 ** np.arange(size, dtype=np.uint64)
    return (planes * factors[:, None]).sum(axis=0), data[n * size :]


def unsummed(steps):
    signed = np.where(steps % 2, -(steps.astype(np.int64) // 2) - 1, steps.astype(np.int64) // 2)
    return np.cumsum(signed, axis=-1) % 2**16


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
        path, words, [variant], [SearchTrial(0, 0.1, 1.0, 0.0, {words: words}, words)], [words]
    )
    shown = Page(path)
    assert shown.header['recordings'][0]['name'] == words
    assert shown.header['variants'] == [words]
    normal = ' '.join(words.replace('\0', '\N{REPLACEMENT CHARACTER}').split())
    texts = ' '.join(''.join(shown.texts).split())
    assert texts.count(normal) >= 4
    assert not [tag for tag, attributes in shown.tags if 'onerror' in attributes]


def test_the_data_are_the_overview(variants):
    recording = [variant.overviews[0] for variant in variants]
    snippets = report_data.choose_snippets([recording])[0]
    assert all(snippets)
    header, data = report_data.pack_recording(recording, 4, snippets)
    rest = zlib.decompress(base64.b64decode(data))
    first, channels, n = recording[0], 16, header['bins']
    lowest, step = np.array(header['lowest_v']), np.array(header['step_v'])
    low, high, _ = first.bins(4)
    assert n == len(low) == 1900
    steps, rest = unplaned(rest, channels * n, 2)
    codes = unsummed(steps.reshape(channels, n))
    span, rest = unplaned(rest, channels * n, 2)
    within = 0.51 * step
    assert np.all(np.abs(lowest + step * codes.T - low) <= within)
    assert np.all(np.abs(lowest + step * (codes + span.reshape(channels, n)).T - high) <= within)

    def intervals(count):
        nonlocal rest
        steps, rest = unplaned(rest, 2 * count, 8)
        return np.cumsum(steps).reshape(-1, 2)

    np.testing.assert_array_equal(intervals(header['truth']), first.truth)
    for overview, variant, mine in zip(recording, header['variants'], snippets, strict=True):
        levels, rest = unplaned(rest, channels * n, 1)
        np.testing.assert_array_equal(levels.reshape(channels, n).T, overview.bins(4)[2])
        np.testing.assert_array_equal(intervals(variant['slip']), overview.slip)
        for group, (name, on) in zip(variant['groups'], overview.groups.items(), strict=True):
            assert group['name'] == name
            np.testing.assert_array_equal(intervals(group['intervals']), on)
        assert variant['snippets'] == [[s.start, len(s.volts)] for s in mine]
        for snippet in mine:
            rows = len(snippet.volts)
            steps, rest = unplaned(rest, channels * rows, 2)
            volts = lowest + step * unsummed(steps.reshape(channels, rows)).T
            assert np.all(np.abs(volts - snippet.volts) <= within)
            levels, rest = unplaned(rest, channels * rows, 1)
            np.testing.assert_array_equal(levels.reshape(channels, rows).T, snippet.codes)
    assert rest == b''


def test_a_channel_without_samples_has_none_in_the_data():
    volts, truth = scenes.volts_and_truth(500)
    volts[:, 3] = np.nan
    volts[100:200, 5] = np.nan
    seen = scenes.overview('a', scenes.GIVEN, volts, truth)
    _, data = report_data.pack_recording([seen], 1, [[]])
    steps, _ = unplaned(zlib.decompress(base64.b64decode(data)), 16 * 500, 2)
    none = unsummed(steps.reshape(16, 500)) == report_data.NO_SAMPLE
    np.testing.assert_array_equal(none.T, np.isnan(volts))


def test_all_recordings_of_a_report_share_the_room(monkeypatch):
    monkeypatch.setattr(report_data, 'MOST_CELLS', 16 * 1000)
    long, short = (
        [scenes.overview('a', scenes.GIVEN, *scenes.volts_and_truth(rows))] for rows in (4000, 300)
    )
    assert report_data.bin_rows([long, short]) == [8, 1]


def test_the_rows_of_false_alarms_and_misses_come_before_those_of_detections(
    monkeypatch, variants
):
    recordings = [[variants[0].overviews[0]]]
    window = 16 * 172
    for room, shown in ((window, 1), (3.9 * window, 3), (100 * window, 4)):
        monkeypatch.setattr(report_data, 'MOST_SNIPPET_CELLS', room)
        ((snippets,),) = report_data.choose_snippets(recordings)
        kinds = {
            event.kind
            for event in scenes.EVENTS['given']
            for s in snippets
            if s.start <= round(event.start_s * 380.0) < s.start + len(s.volts)
        }
        assert len(kinds) == shown
        assert ('detected' in kinds) == (shown == 4)


def test_very_many_intervals_are_joined_where_no_bin_lies_between(monkeypatch):
    monkeypatch.setattr(report_data, 'MOST_INTERVALS', 2)
    rows = np.array([[0, 5], [7, 9], [50, 60], [62, 70]])
    np.testing.assert_array_equal(report_data._joined(rows, 8), [[0, 9], [50, 70]])
    np.testing.assert_array_equal(report_data._joined(rows[:2], 8), rows[:2])


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


def test_without_trials_there_is_no_front(tmp_path, page, variants):
    assert any('5 trials, of which 3 are not beaten' in text for text in page.texts)
    assert any('1 are not drawn' in text for text in page.texts)
    report.write_page(tmp_path / 'report.html', 'A title', variants[:1])
    assert 'Trade-off' not in Page(tmp_path / 'report.html').texts


def test_parameters_that_differ_are_shown_first(page):
    text = '|'.join(text for text in page.texts if text.strip())
    assert '|passband_hz|7 50|10 60|' in text
    assert text.index('|vote|all|mean|') < text.index('All parameters') < text.index('|channels|')


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


@pytest.mark.parametrize('name', ['$a_$ $', '\u6ed1\u308a.npz', 'a\x1fb', 'a/b'])
def test_pictures_take_any_name(tmp_path, name):
    seen = scenes.overview(name, scenes.GIVEN, *scenes.volts_and_truth(500))
    paths = report.write_pictures(tmp_path, [Variant(name, scenes.GIVEN, [seen], {name: {}})])
    assert all(path.parent == tmp_path and path.is_file() for path in paths)


def test_what_cannot_be_written_is_one_line(tmp_path, variants):
    with pytest.raises(ValueError, match=r'no/report.html: cannot be written \(No such file'):
        report.write_page(tmp_path / 'no' / 'report.html', 'A title', variants[:1])
    (tmp_path / 'file').write_text('')
    with pytest.raises(ValueError, match=r'file/out: cannot be written \(Not a directory'):
        report.write_pictures(tmp_path / 'file' / 'out', variants[:1])


def costs():
    return st.one_of(st.none(), st.integers(0, 3).map(float))


@given(st.lists(st.tuples(costs(), costs(), costs()), max_size=12))
def test_the_front_is_what_no_trial_beats(table):
    trials = [SearchTrial(i, *row) for i, row in enumerate(table)]
    known = [trial for trial in trials if None not in trial[1:4]]

    def beaten(trial):
        return any(
            all(a <= b for a, b in zip(other[1:4], trial[1:4], strict=True))
            and other[1:4] != trial[1:4]
            for other in known
        )

    assert {t.number for t in trade_off_front(trials)} == {
        t.number for t in known if not beaten(t)
    }
