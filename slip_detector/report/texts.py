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

"""What figures say in words: the answer in sentences, tables of plain text, single figures."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from slip_detector.evaluation.figures import ALREADY_ON, STAGES
from slip_detector.parameters import name_list
from slip_detector.recordings.labels import KINDS
from slip_detector.tuning.problem import beats_chance, worse_figures

#: The text of a figure that is not defined.
UNDEFINED = '-'

#: Units by the last word of a figure's name.
UNITS = {'ms': 'ms', 's': 's', 'percent': '%'}

#: The kinds of recordings, in words that follow ON.
ON_IN = dict(zip(KINDS, ('at rest', 'in taps', 'in presses', 'in rolls', 'idle'), strict=True))

#: Headings of the figures whose names alone say too little.
HEADINGS = {
    'matched': 'detected',
    'recall': 'share found',
    'recall_by_chance': 'found by guessing',
    'sooner_than_chance': 'better than guessing',
    'settling_slips': 'while settling',
    'settling_alarms': 'while settling',
    'on_s': 'ON [s]',
    'on_percent': 'ON [% of the time]',
    'false_time_percent': 'ON without slip [%]',
    'gaps': 'gaps bridged',
    'auc': 'how far slips stand out',
    'coverage': 'ON during slips',
    **{f'{kind}_on_percent': f'ON {where} [%]' for kind, where in ON_IN.items()},
}

#: The figures in each table of an evaluation, by its title.
TABLES: dict[str, Sequence[str]] = {
    'rows': ('rows', 'slip_rows', 'moving_rows', 'settling_rows', 'auc_all'),
    'slips': (
        'slips', 'settling_slips', 'matched', 'late', 'missed', 'recall', 'recall_by_chance',
        'sooner_than_chance', 'coverage',
    ),
    'latency': (
        'latency_median_all_ms', 'latency_median_ms', 'latency_p90_ms', 'latency_worst_ms',
        'latency_accuracy_ms',
    ),
    'alarms': (
        'alarms', 'settling_alarms', 'repeated_alarms', 'false_alarms', 'precision',
        'precision_by_chance',
    ),
    'rest': ('rest_s', 'false_alarms_per_minute', 'false_time_percent'),
    'kinds': [
        'auc', 'auc_moving', *(f'auc_{kind}' for kind in KINDS),
        *(f'{kind}_{what}' for kind in KINDS for what in ('on_percent', 'alarms_per_minute')),
    ],
    'decisions': ('onsets', 'onsets_per_minute', 'on_s', 'on_percent', 'invalid_channels'),
    'mean latency, by stage': [f'{stage}_ms' for stage in STAGES],
    'of the late ones': [f'late_{stage}_ms' for stage in STAGES],
    'missed slips, lost at': [*(f'missed_at_{stage}' for stage in STAGES), f'missed_{ALREADY_ON}'],
    'faults': ('bad_samples', 'gaps', 'bridged_rows', 'long_gaps', 'dropped'),
}  # fmt: skip

#: The figures that are compared.
COMPARABLE = [n for title in ('slips', 'latency', 'rest', 'kinds') for n in TABLES[title]]

#: The tables that are printed without ``--verbose``.
MAIN_TABLES = ('slips', 'latency', 'rest', 'missed slips, lost at', 'faults')

#: Texts of figures that say nothing. Rows and columns with no other text are left out.
EMPTY = {UNDEFINED, '0', '0.0'}

LEGEND = f'{UNDEFINED}: not defined (no labels, no such rows or events, or no record of motion)'

Figures = Mapping[str, Any]

#: The figures of the time ON without slip: of all of it, and of each kind of recordings.
ALL = 'false_time_percent'
ON_FIGURES = (ALL, *(f'{kind}_on_percent' for kind in KINDS))

#: A recording that is ON without slip for at least this share of the time is called bad.
BAD_PERCENT = 1.0

#: Title of a figure, its text before and after a change, and 'better', 'worse' or ''.
Row = tuple[str, str, str, str]


def text_table(rows: Sequence[Sequence[str]], alignment: str = '<>', indent: int = 2) -> str:
    """Return rows of text as a table whose columns are two spaces apart.

    Parameters
    ----------
    rows
        Rows of cells; a row may have fewer cells than others.
    alignment
        One character for each column: ``<`` aligns its cells to the left, ``>`` to the right. The
        last character applies to all further columns too.
    indent
        Spaces before the first column.

    Examples
    --------
    >>> print(text_table([('plate', 'delay [ms]'), ('400 um', '38.98'), ('all', '-')], indent=0))
    plate   delay [ms]
    400 um       38.98
    all              -
    """
    widths = [max(map(len, column)) for column in itertools.zip_longest(*rows, fillvalue='')]
    sides = alignment.ljust(len(widths), alignment[-1])
    lines = []
    for row in rows:
        cells = zip(row, sides, widths, strict=False)
        padded = '  '.join(f'{cell:{side}{width}}' for cell, side, width in cells)
        lines.append((' ' * indent + padded).rstrip())
    return '\n'.join(lines)


def number_text(value: float | None, form: str) -> str:
    """Return a figure in one of Python's formats; a dash where it is not defined."""
    return UNDEFINED if value is None else format(value, form)


def figure_text(name: str, figures: Figures) -> str:
    """Return one of several figures as text, with the digits that its name asks for.

    A latency below 0 is no early detection: ``slip`` was ON before the label, for example from an
    unrelated alarm. The text says so. Where labels are not exact, the text is the range of the
    latency, or that the latency is not known.

    Examples
    --------
    >>> figures = {'sd_ms': 41.26, 'recall': 0.95, 'auc': None, 'latency_p90_ms': -96.3}
    >>> [figure_text(name, figures) for name in figures]
    ['41.3', '0.950', '-', 'ON 96.3 before']
    >>> by_hand = {'latency_accuracy_ms': 350.0, 'latency_p90_ms': 0.0, 'latency_worst_ms': 120.0}
    >>> [figure_text(name, by_hand) for name in by_hand]
    ['350.0', '± 350: not known', '120 to 820']
    """
    value, accuracy_ms = figures.get(name), figures.get('latency_accuracy_ms')
    if isinstance(value, int):
        return str(value)
    if name.startswith('latency') and value is not None and name != 'latency_accuracy_ms':
        if value < 0.0:
            return f'ON {-value:.1f} before'
        if accuracy_ms:
            more = f'{value:.0f} to {value + 2.0 * accuracy_ms:.0f}'
            return more if value else f'± {accuracy_ms:.0f}: not known'
    if name.endswith(('_ms', '_s')):
        return number_text(value, '.1f')
    return number_text(value, '.2f' if name.endswith(('_percent', '_per_minute')) else '.3f')


def heading(name: str) -> str:
    """Return the name of a figure as a heading, with its unit in brackets.

    Examples
    --------
    >>> heading('latency_p90_ms'), heading('matched')
    ('latency p90 [ms]', 'detected')
    """
    if name in HEADINGS:
        return HEADINGS[name]
    words = name.replace('auc', 'AUC').replace('by_chance', 'by_guessing').split('_')
    unit = f' [{UNITS[words.pop()]}]' if words[-1] in UNITS and len(words) > 1 else ''
    return ' '.join(words) + unit


def evaluation_tables(report: Mapping[str, Any], verbose: bool = False) -> str:
    """Return a report of ``slip_evaluate`` as text: its answer, tables, and lines about it.

    Parameters
    ----------
    report
        As :func:`slip_detector.commands.evaluate.as_report` returns it.
    verbose
        Whether all tables are printed; else :data:`MAIN_TABLES`.
    """
    rows, notes = by_name(report['sets']), list[str]()
    for name, figures in rows.items():
        if not figures['labelled']:
            on_s = [f'{start:.3f} to {end:.3f}' for start, end in figures['on_intervals_s']]
            notes.append(f'{name}: {f"ON from {name_list(on_s, 12)} s" if on_s else "never ON"}')
    for folder, whole in report['sets'].items() if len(report['sets']) > 1 else ():
        rows[f'all of {folder}'] = whole
    rows |= {'all recordings': report['all']} if len(rows) != 1 else {}
    titles = TABLES if verbose else MAIN_TABLES
    blocks = figure_tables(rows, {title: TABLES[title] for title in titles})
    if any(cell == UNDEFINED for block in blocks for row in block for cell in row):
        notes.append(LEGEND)
    notes += [report['note']] if 'note' in report else []
    ends = {'not_evaluated': 'Stopped early, not evaluated', 'written': 'Written'}
    notes += [f'{what}: {", ".join(report[key])}' for key, what in ends.items() if key in report]
    tables = (text_table(block, indent=0) for block in blocks)
    return '\n\n'.join(filter(None, ['\n'.join(report['answer']), *tables, '\n'.join(notes)]))


def by_name(sets: Mapping[str, Figures]) -> dict[str, Mapping[str, Any]]:
    """Return the recordings of a report by name, with the folder where there are several."""
    return {
        f'{folder}/{file}' if len(sets) > 1 else file: figures
        for folder, whole in sets.items()
        for file, figures in whole['recordings'].items()
    }


def figure_tables(
    rows: Mapping[str, Figures], named: Mapping[str, Sequence[str]]
) -> list[list[list[str]]]:
    """Return the cells of tables without the rows, columns and tables that say nothing.

    Parameters
    ----------
    rows
        Figures, by the name of the row.
    named
        The names of the figures of each table, by its title.

    Examples
    --------
    >>> rows = {'a': {'slips': 3, 'missed': 0}, 'b': {'slips': 0, 'missed': 0}}
    >>> figure_tables(rows, {'slips': ['slips', 'missed'], 'missed': ['missed']})
    [[['slips', 'slips'], ['a', '3']]]
    """
    tables = []
    for title, names in named.items():
        heads = [heading(name).removeprefix(f'{title} ') for name in names]
        cells = [[row, *(figure_text(name, rows[row]) for name in names)] for row in rows]
        filled = [row for row in cells if not EMPTY.issuperset(row[1:])]
        columns = zip([title, *heads], *filled, strict=True)
        kept = [column for column in columns if not EMPTY.issuperset(column[1:])]
        tables += [list(map(list, zip(*kept, strict=True)))] if filled else []
    return tables


def compare(before: Figures, after: Figures) -> list[Row]:
    """Return two sets of figures side by side, each with its title and 'better' or 'worse'.

    Figures with the same text in both are left out. Figures that a search compares are better or
    worse as it decides, see :func:`.problem.worse_figures`; the other figures are neither.

    Parameters
    ----------
    before, after
        Figures as :func:`slip_detector.evaluation.figures.figures_of_merit` returns them.

    Examples
    --------
    >>> from slip_detector.evaluation.figures import figures_of_merit
    >>> before = {**figures_of_merit([]), 'sooner_than_chance': 0.7, 'recall': 0.8}
    >>> compare(before, {**before, 'recall': 0.95})
    [('share found', '0.800', '0.950', 'better')]
    """
    worse, better = worse_figures(after, before), worse_figures(before, after)
    rows = []
    for name in COMPARABLE:
        was, now = figure_text(name, before), figure_text(name, after)
        if was != now:
            change = 'worse' if name in worse else 'better' if name in better else ''
            rows.append((heading(name), was, now, change))
    return rows


def answer(after: Figures, before: Figures | None = None) -> list[str]:
    """Return in sentences how good figures are, and what got worse.

    A chain that finds slips no better than alarms at random is not called good.

    Parameters
    ----------
    after
        As :func:`slip_detector.evaluation.figures.figures_of_merit` returns them, or for
        recordings without labels :func:`slip_detector.evaluation.evaluator.recording_figures`.
    before
        Figures of the same recordings before a change; None: there was none.

    Returns
    -------
    list of str
        A line on how good they are; and where :func:`.compare` finds something worse, a line on
        that.

    Examples
    --------
    >>> from slip_detector.evaluation.figures import figures_of_merit
    >>> answer(figures_of_merit([]))
    ['No slips to find.']
    """
    if after['slips'] is None:
        time_on = f'ON {say_number(after["on_percent"] or 0.0)} % of the time'
        return [f'{time_on}: without labels nobody knows whether rightly.']
    sentences = [_slips_found(after, before)]
    if settling := after['settling_slips']:
        sentences.append(f'Not counted: {settling} that began before it was ready')
    if already_on := after[f'missed_{ALREADY_ON}']:
        sentences.append(f'It was ON already before {already_on} of them')
    sentences += _time_on(after, before or {})
    alarms = after['false_alarms_per_minute']
    # A detector that is mostly ON has few alarms.
    if alarms is not None and (alarms >= 0.5 or not before) and after['false_time_percent'] < 50.0:
        sentences.append(f'False alarms: {say_number(alarms)} a minute')
    lines, worse = [f'{". ".join(sentences)}.'], list[str]()
    for title, was, now, change in compare(before or after, after):
        if change == 'worse':
            words, _, unit = title.rstrip(']').partition(' [')
            worse.append(f'{words} {was} → {now} {unit}'.rstrip())
    return [*lines, f'Worse: {", ".join(worse)}.'] if worse else lines


def bad_recordings(recordings: Mapping[str, Figures]) -> list[str]:
    """Return a line on the recording that misses most, or is ON most, and one on each fault.

    Parameters
    ----------
    recordings
        By their names, as in a report of ``slip_evaluate``; without their faults where those are
        not known.

    Examples
    --------
    >>> bad = {'missed': None, 'false_time_percent': None, 'invalid_percent': {'ch3': 12.5}}
    >>> bad_recordings({'a.mcap': bad, 'b.mcap': bad})
    ['a.mcap, b.mcap: not valid: ch3 12.5 % of the time']
    """

    def badness(name: str) -> tuple[int, float]:
        figures = recordings[name]
        return figures['missed'] or 0, figures['false_time_percent'] or 0.0

    lines, names_of = list[str](), dict[str, list[str]]()
    worst = max(recordings, key=badness, default='')
    if len(recordings) > 1 and badness(worst) >= (0, BAD_PERCENT):
        lines.append(f'Worst: {worst}. {answer(recordings[worst])[0]}')
    for name, figures in recordings.items():
        shares = [f'{ch} {part:.3g} %' for ch, part in figures.get('invalid_percent', {}).items()]
        invalid = f'not valid: {name_list(shares)} of the time' if shares else ''
        faults = figures.get('lost'), figures.get('doubts'), *figures.get('warnings', ()), invalid
        for text in filter(None, faults):
            names_of.setdefault(text, []).append(name)
    return lines + [f'{name_list(names, 3)}: {text}' for text, names in names_of.items()]


def say_number(value: float | None) -> str:
    """Return a number as people say it; empty where it is not known.

    Examples
    --------
    >>> say_number(18.7), say_number(0.034)
    ('19', '0.03')
    """
    if value is None:
        return ''
    return f'{value:.0f}' if value >= 1.0 or not value else f'{value:.1g}'


def _slips_found(after: Figures, before: Figures | None) -> str:
    """Return how many slips are found, and how soon, and whether guessing does as well."""
    matched, scored = after['matched'], after['matched'] + after['missed']
    if not scored:
        return 'No slips to find'
    text = f'Finds {matched or "none"} of {scored} slip{"" if scored == 1 else "s"}'
    if before and before['matched'] != matched:
        by_chance = before['matched'] and not beats_chance(before)
        text += f' (before: {before["matched"] or "none"}{" by guessing" if by_chance else ""})'
    if matched and after['sooner_than_chance'] is None:
        return f'{text}; without rest nobody knows whether by guessing'
    if matched and not beats_chance(after):
        return f'{text}, no better than guessing'
    guessed = round((after['recall_by_chance'] or 0.0) * scored)
    if 2 * guessed >= matched > 0:
        text += f' where guessing would find {guessed}'
    value_ms, accuracy_ms = after['latency_median_ms'], after['latency_accuracy_ms']
    if value_ms is None:
        return text
    if accuracy_ms and value_ms >= 0.0:
        latest_ms = value_ms + (2.0 * accuracy_ms if value_ms else accuracy_ms)
        return f'{text}, within {latest_ms / 1e3:.2g} s, as far as the labels tell'
    side, begin = 'before' if value_ms < 0.0 else 'after', 'begins' if matched == 1 else 'begin'
    return f'{text}, some {abs(value_ms):.0f} ms {side} {"it" if matched == 1 else "they"} {begin}'


def _time_on(after: Figures, before: Figures) -> list[str]:
    """Return how much of the time without slip, and of each kind of recordings, is ON."""
    known = {name: after[name] for name in ON_FIGURES if after[name] is not None}
    whole, texts = known.pop(ALL, None), list[str]()
    if whole is None:
        return texts
    # The share of all the time is above that of each kind only if it is ON between the slips.
    if after['rest_on_percent'] is None or whole > max(known.values()):
        known = {ALL: whole, **known}
    for name in known:
        where = heading(name).removeprefix('ON ').removeprefix('in ').removesuffix(' [%]')
        was, now = say_number(before.get(name)), say_number(after[name])
        change = now if was in ('', now) else f'{was} % → {now}'
        texts.append(f'{where} {change} %'.replace('→ 0 %', '→ 0'))
    return [f'ON {", ".join(texts)}']
