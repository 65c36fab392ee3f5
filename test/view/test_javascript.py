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

"""The JavaScript of the pages without a page: how it is written, columns, stretches and bins."""

import base64
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from slip_detector.report.page import SCRIPTS
from slip_detector.view.server import FOLDERS
from slip_detector.view.view_request import pack_frame

PAGE, SHARED = FOLDERS['page'], FOLDERS['drawing']
FILES = sorted([*PAGE.glob('*.js'), *SHARED.glob('*.js')])

#: Most lines of all scripts, and most columns of a line.
MOST_LINES, MOST_COLUMNS = 2_900, 99

#: Scripts that the page loads before its modules: what they declare is known in these.
LOADED_BEFORE = ('numbers.js', 'drawing.js', 'timeline.js')

DECLARED = re.compile(r'^(?:const|let|function|class|async function) (.*?)(?:[({]|$)', re.M)


def node(code):
    """Run a module beside the scripts that need no page; return what it gives to ``say``."""
    package = pytest.importorskip('playwright')
    program = Path(package.__file__).parent / 'driver' / 'node'
    scripts = [str(SHARED / name) for name in ('numbers.js', 'bins.js')]
    module = f"""import {{readFileSync}} from 'node:fs';
        import {{runInThisContext}} from 'node:vm';
        for (const path of {scripts}) runInThisContext(readFileSync(path, 'utf8'));
        const {{Columns, Stretch}} = await import('{PAGE.as_uri()}/stretch.js');
        const {{readFrame}} = await import('{PAGE.as_uri()}/connection.js');
        const say = (value) => console.log(JSON.stringify(value));
        {code}"""
    command = [program, '--input-type=module', '--eval', module]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, '')
    return json.loads(done.stdout)


def test_scripts_are_as_short_as_they_are_said_to_be():
    lines = [line for file in FILES for line in file.read_text(encoding='utf-8').splitlines()]
    assert [line for line in lines if len(line) > MOST_COLUMNS] == []
    assert len(lines) <= MOST_LINES


def declared(names):
    """Return what scripts declare for all: the names before each equals sign."""
    for name in names:
        for words in DECLARED.findall((SHARED / name).read_text(encoding='utf-8')):
            yield from re.findall(r'(\w+)(?= = )', words) or [words.strip()]


def test_the_linter_finds_nothing(tmp_path):
    program = shutil.which('oxlint', path=Path(sys.executable).parent)
    if program is None:
        pytest.skip('needs oxlint')
    # Scripts of the report share one scope.
    together = tmp_path / 'report.js'
    together.write_text('\n'.join((SHARED / name).read_text('utf-8') for name in SCRIPTS))
    # What the page alone needs of the scripts that it shares with the report.
    page_only = {'varsIgnorePattern': '^(rounded|steady|TRUTH)$'}
    settings = tmp_path / 'settings.json'
    settings.write_text(
        json.dumps(
            {
                'env': {'browser': True, 'es2024': True},
                'rules': {'no-unused-vars': ['error', page_only], 'eqeqeq': ['error', 'smart']},
                'globals': dict.fromkeys([*declared(LOADED_BEFORE), 'uPlot'], 'readonly'),
            }
        )
    )
    rules = '-Dcorrectness', '-Dno-undef', '-Dprefer-const', '-Dno-var', '-Deqeqeq'
    command = [program, '--config', settings, *rules, '--format=unix', PAGE, together]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout


NO_SAMPLES = '{first: 0, count: 0}'


def test_columns_follow_one_another_and_a_long_gap_leaves_none_of_before():
    low, seen, far = node(f"""
        const columns = new Columns({{width_ns: 1e8, channels: [1]}}, 50, null);
        const take = (first, values) => columns.take(
          {{samples: {{first, count: values.length}}, levels: {NO_SAMPLES}}},
          {{low: values, high: values.map((v) => v + 1), truth: values}});
        take(1000, [1, 2, NaN]);
        take(1003, [4]);
        const low = [...columns.parts.low[0]], seen = columns.between(40, 40.15);
        take(1e6, [8, 9]);
        say([low, seen, columns.parts.low[0]]);
    """)
    assert (low, far) == ([1, 2, None, 4], [8, 9])
    # The first column begins at 100 s, 40 s after a whole minute.
    assert seen['x'] == pytest.approx([40.0, 40.1, 40.2])
    assert (seen['low'], seen['high']) == ([[1, 2, None]], [[2, 3, None]])


def test_only_the_newest_columns_are_kept():
    kept = node(f"""
        const columns = new Columns({{width_ns: 1e9, channels: [3, 5]}}, 4, 0);
        for (let first = 60; first < 70; first++) columns.take(
          {{samples: {NO_SAMPLES}, levels: {{first, count: 1}}}},
          {{level: [first, -first], slip: [1]}});
        say([columns.base, columns.last_s, columns.parts.level, columns.between(0, 99).x]);
    """)
    assert kept == [66, 70, [[66, 67, 68, 69], [-66, -67, -68, -69]], [66, 67, 68, 69]]


def test_a_stretch_is_live_paused_zoomed_and_never_leaves_what_is_kept():
    ends = node("""
        const stretch = new Stretch(), ends = [];
        const after = (act) => {
          act();
          ends.push([stretch.live, ...stretch.ends()]);
        };
        after(() => (stretch.columns = {last_s: 100}));
        after(() => stretch.change(95, 100, 'zoom'));
        after(() => stretch.change(90, 95, 'move'));
        after(() => (stretch.columns.last_s = 130));
        after(() => stretch.change(500, 510, 'move'));
        after(() => stretch.change(-500, -490, 'zoom'));
        after(() => stretch.change(50, 50, 'zoom'));
        after(() => stretch.change(-Infinity, Infinity, 'whole'));
        after(() => stretch.change(0, 1e9, 'zoom'));
        say(ends);
    """)
    assert ends == [
        [True, 90, 100], [True, 95, 100], [False, 90, 95], [False, 90, 95], [False, 90.5, 100.5],
        [False, 40, 50], [False, pytest.approx(49.99), pytest.approx(50.01)], [True, 120, 130],
        [True, 70, 130],
    ]  # fmt: skip


def test_bins_are_joined_and_those_in_view_are_chosen():
    sizes, joined, far, near = node("""
        const channels = 2, n = 1300, values = Uint16Array.from({length: 2 * n}, (_, i) => i);
        const low = halved(values, channels, n, Math.min);
        const high = halved(values, channels, n, higherVolts), data = {low, high, variants: [low]};
        const chosen = (...ends) => {
          const {low: l, high: h, codes, ...bins} = binsBetween(...ends);
          return {...bins, low: l[bins.n + bins.first], high: h[bins.n + bins.first]};
        };
        say([low.map((each) => each.n), [higherVolts(3, NO_SAMPLE), higherVolts(3, 4)],
          chosen(0, 2600, data, 0, 2, 8), chosen(100, 104, data, 0, 2, 0.5)]);
    """)
    assert sizes == [1300, 650, 325]
    assert joined == [3, 4]
    # Of the second channel the first bin in view: the least and the highest of four.
    assert far == {'rows': 8, 'n': 325, 'first': 0, 'stop': 325, 'low': 1300, 'high': 1303}
    assert near == {'rows': 2, 'n': 1300, 'first': 49, 'stop': 53, 'low': 1349, 'high': 1349}


def test_numbers_are_in_words_and_ticks_at_round_ones():
    words, steps, ranges = node("""
        const between = (from, to, s) => {
          const {times, digits} = ticksBetween(from, to, s);
          return [times.map((each) => each.toFixed(digits)).join(' ')];
        };
        say([
          [4.3, 0.0123, 4e-7, 0, 1e6, -1234.5].map(volts)
            .concat(voltsBetween(1, 2), timeText(3661.25, 2), timeText(0, 0)),
          [between(1.03, 1.5, 0.09), between(-1, 100, 20), between(0, 1e7, 4e6)],
          [steady(null, [0, 1], 0.5, 0.1),
            ...[[1, 8], [1, 2], [1, 11]].map((each) => steady([0, 10], each, 0.5)),
            rangeOf([3, null, -1]), rangeOf([null])],
        ]);
    """)
    assert words == [
        '4.300 V', '12.3 mV', '4.00e-7 V', '0.00 mV', '1.00e+6 V', '-1234.50 V',
        '1.000 V to 2.000 V', '01:01:01.25', '00:00:00',
    ]  # fmt: skip
    assert steps == [
        ['1.1 1.2 1.3 1.4 1.5'],
        ['0 30 60 90'],
        [' '.join(map(str, range(0, 10**7, 864000)))],
    ]
    assert ranges == [[-0.1, 1.1], [0, 10], [1, 2], [1, 11], [-1, 3], None]


def test_a_frame_is_read_as_it_was_packed():
    arrays = {'level/0': np.array([[0.5, np.nan], [2.0, 3.0]]), 'on/0': np.array([True, False])}
    frame = base64.b64encode(pack_frame({'fingers': ['\u00e4']}, arrays)).decode()
    header, level, on = node(f"""
        const bytes = Uint8Array.from(atob('{frame}'), (c) => c.charCodeAt(0));
        const {{header, arrays}} = readFrame(bytes.buffer);
        say([header.fingers, [...arrays['level/0']], [...arrays['on/0']]]);
    """)
    assert (header, level, on) == (['\u00e4'], [0.5, None, 2.0, 3.0], [1, 0])
