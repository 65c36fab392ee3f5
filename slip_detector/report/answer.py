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

"""The answer in sentences that a reader sees first: how good a detector is, and what got worse."""

from collections.abc import Mapping
from typing import Any

from slip_detector.evaluation.figures import ALREADY_ON
from slip_detector.parameters import name_list
from slip_detector.recordings.labels import KINDS
from slip_detector.report.tables import compared, heading
from slip_detector.tuning.problem import beats_chance

Figures = Mapping[str, Any]

#: The figures of the time ON without slip: of all of it, and of each kind of recordings.
ALL = 'false_time_percent'
ON_FIGURES = (ALL, *(f'{kind}_on_percent' for kind in KINDS))

#: A recording that is ON without slip for at least this share of the time is called bad.
BAD_PERCENT = 1.0


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
        A line on how good they are; and where :func:`.compared` finds something worse, a line on
        that.

    Examples
    --------
    >>> from slip_detector.evaluation.figures import figures_of_merit
    >>> answer(figures_of_merit([]))
    ['No slips to find.']
    """
    if after['slips'] is None:
        time_on = f'ON {rounded(after["on_percent"] or 0.0)} % of the time'
        return [f'{time_on}: without labels nobody knows whether rightly.']
    sentences = [_slips_found(after, before)]
    if settling := after['settling_slips']:
        sentences.append(f'Not counted: {settling} that began before it was ready')
    if already_on := after[f'missed_{ALREADY_ON}']:
        sentences.append(f'It was ON already before {already_on} of them')
    sentences += _time_on(after, before or {})
    alarms = after['false_alarms_per_minute']
    # What is mostly ON has few alarms.
    if alarms is not None and (alarms >= 0.5 or not before) and after['false_time_percent'] < 50.0:
        sentences.append(f'False alarms: {rounded(alarms)} a minute')
    lines, worse = [f'{". ".join(sentences)}.'], list[str]()
    for title, was, now, change in compared(before or after, after):
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
        faults = figures.get('lost'), *figures.get('warnings', ()), invalid
        for text in filter(None, faults):
            names_of.setdefault(text, []).append(name)
    return lines + [f'{name_list(names, 3)}: {text}' for text, names in names_of.items()]


def rounded(value: float | None) -> str:
    """Return a number as people say it; empty where it is not known.

    Examples
    --------
    >>> rounded(18.7), rounded(0.034)
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
    side = 'before' if value_ms < 0.0 else 'after'
    return f'{text}, some {abs(value_ms):.0f} ms {side} they begin'


def _time_on(after: Figures, before: Figures) -> list[str]:
    """Return how much of the time without slip, and of each kind of recordings, is ON."""
    known = {name: after[name] for name in ON_FIGURES if after[name] is not None}
    whole, texts = known.pop(ALL, None), list[str]()
    if whole is None:
        return texts
    # All the time is ON more than each kind only where it is ON between the slips.
    if after['rest_on_percent'] is None or whole > max(known.values()):
        known = {ALL: whole, **known}
    for name in known:
        where = heading(name).removeprefix('ON ').removeprefix('in ').removesuffix(' [%]')
        was, now = rounded(before.get(name)), rounded(after[name])
        change = now if was in ('', now) else f'{was} % → {now}'
        texts.append(f'{where} {change} %'.replace('→ 0 %', '→ 0'))
    return [f'ON {", ".join(texts)}']
