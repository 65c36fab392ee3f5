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

"""The answer in sentences that one reads first: is it good, and what got worse."""

from collections.abc import Mapping
from typing import Any

from slip_detector.evaluation.chance import HALF
from slip_detector.evaluation.figures import ALREADY_ON
from slip_detector.recordings.labels import KINDS
from slip_detector.report.tables import figure_text, heading, main_figures
from slip_detector.tuning.problem import better_than_chance, worse_figures

Figures = Mapping[str, Any]

#: Title of a figure, the figure before and after, and 'better', 'worse' or ''.
Row = tuple[str, str, str, str]

#: The shares of time ON without slip.
ON_PERCENT = ('false_time_percent', *(f'{kind}_on_percent' for kind in KINDS))

#: From this share of slips missed, or of time ON without slip, a recording is called the worst.
BAD = 0.01


def answer(after: Figures, before: Figures | None = None) -> list[str]:
    """Return in sentences how good figures are, and what got worse.

    What finds slips no better than guessing, which is alarms at random, is not called good.

    Parameters
    ----------
    after
        As :func:`slip_detector.evaluation.figures.figures_of_merit` returns them, or for
        recordings without labels :func:`slip_detector.evaluation.evaluator.recording_figures`.
    before
        Those of the same recordings before a change; None: there was none.

    Returns
    -------
    list of str
        What holds; and where something got worse, as :func:`compared` says, what.

    Examples
    --------
    >>> from slip_detector.evaluation.figures import figures_of_merit
    >>> answer(figures_of_merit([]))
    ['No slips to find.']
    """
    if after['slips'] is None:
        often, percent = after['onsets'], rounded(after['on_percent'] or 0.0)
        text = (
            f'Turns ON {often} time{"" if often == 1 else "s"}, and is ON {percent} % of the time'
        )
        return [f'{text}. Without labels nobody knows whether rightly.']
    said = [_found(after, before), _on_without_slip(after, before or {})]
    if after['settling_slips']:
        said.insert(1, f'Not counted: {after["settling_slips"]} that began before it was ready')
    if after[f'missed_{ALREADY_ON}']:
        said.insert(1, f'It was ON already before {after[f"missed_{ALREADY_ON}"]} of them')
    alarms = after['false_alarms_per_minute']
    # What is mostly ON has few alarms.
    if alarms is not None and (alarms >= 0.5 or not before) and after['false_time_percent'] < 50.0:
        said.append(f'False alarms: {rounded(alarms)} a minute')
    sentences = [f'{". ".join(filter(None, said))}.']
    if worse := [
        _changed(*row[:3]) for row in compared(before or after, after) if row[3] == 'worse'
    ]:
        sentences.append(f'Worse: {", ".join(worse)}.')
    return sentences


def _changed(title: str, was: str, now: str) -> str:
    """Return a row of a comparison in words."""
    words, _, unit = title.rstrip(']').partition(' [')
    return f'{words} {was} → {now} {unit}'.rstrip()


def worst(recordings: Mapping[str, Figures]) -> list[str]:
    """Return a line on the recording with the most missed slips and time ON without slip.

    Examples
    --------
    >>> worst({})
    []
    """

    def badness(figures: Figures) -> float:
        missed = figures['missed'] / (figures['matched'] + figures['missed'] or 1)
        return float(missed + (figures['false_time_percent'] or 0.0) / 100.0)

    known = {name: badness(one) for name, one in recordings.items() if one['slips'] is not None}
    name = max(known, key=lambda one: known[one], default='')
    bad = len(recordings) > 1 and known.get(name, 0.0) >= BAD
    return [f'Worst: {name}. {answer(recordings[name])[0]}'] if bad else []


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


def _found(after: Figures, before: Figures | None) -> str:
    """Return how many slips are found, and how soon, and whether guessing does as well."""
    matched, scored = after['matched'], after['matched'] + after['missed']
    if not scored:
        return 'No slips to find'
    text = f'Finds {matched or "none"} of {scored} slip{"" if scored == 1 else "s"}'
    if before and before['matched'] != matched:
        by_chance = before['matched'] and not better_than_chance(before)
        text += f' (before: {before["matched"] or "none"}{" by guessing" if by_chance else ""})'
    if matched and not better_than_chance(after):
        return f'{text}, no better than guessing'
    if matched and after['sooner_than_chance'] < HALF:
        text += f', guessing would find some {after["recall_by_chance"] * scored:.0f}'
    delay, its_delay = _delay(after), _delay(before or after)
    if delay and its_delay not in ('', delay):
        delay += f' (before: {its_delay.removesuffix(" after they begin")})'
    return f'{text}, {delay}' if delay else text


def _delay(figures: Figures) -> str:
    """Return how soon slips are found, as exactly as their labels are; empty if not known."""
    value_ms, accuracy_ms = figures['latency_median_ms'], figures['latency_accuracy_ms']
    if value_ms is None:
        return ''
    if value_ms < 0.0:
        return f'ON already some {-value_ms:.0f} ms before they begin'
    if not accuracy_ms:
        return f'some {value_ms:.0f} ms after they begin'
    if not value_ms:
        return f'within {accuracy_ms / 1e3:.2g} s, the accuracy of the labels'
    return f'{value_ms:.0f} to {value_ms + 2.0 * accuracy_ms:.0f} ms after they begin'


def _on_without_slip(after: Figures, before: Figures) -> str:
    """Return how much of the time without slip, and of each kind of recordings, is ON."""
    _, *kinds = known = [name for name in ON_PERCENT if after[name] is not None] or ['']
    # All time without slip is ON more than each kind only where it is ON between the slips.
    if 'rest_on_percent' in kinds and after[known[0]] <= max(after[name] for name in kinds):
        known = kinds
    texts = []
    for name in filter(None, known):
        where = heading(name).removeprefix('ON ').removeprefix('in ').removesuffix(' [%]')
        was, now = (rounded(one.get(name)) for one in (before, after))
        changed = was not in ('', now)
        percent = '' if changed and now == '0' else ' %'
        texts.append(f'{where} {was} % → {now}{percent}' if changed else f'{where} {now} %')
    return f'ON {", ".join(texts)}' if texts else ''


def compared(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[Row]:
    """Return two sets of figures side by side, each with its title and 'better' or 'worse'.

    What is the same, or not known, in both is left out. What a search compares is better or worse
    as it decides, see :func:`.problem.worse_figures`; the other figures are neither.

    Parameters
    ----------
    before, after
        Figures as :func:`slip_detector.evaluation.figures.figures_of_merit` returns them.

    Examples
    --------
    >>> from slip_detector.evaluation.figures import figures_of_merit
    >>> before = {**figures_of_merit([]), 'sooner_than_chance': 0.7, 'recall': 0.8}
    >>> compared(before, {**before, 'recall': 0.95})
    [('recall', '0.800', '0.950', 'better')]
    """
    worse, better = worse_figures(after, before), worse_figures(before, after)
    rows = []
    for name in main_figures([before, after]):
        was, now = figure_text(name, before), figure_text(name, after)
        if was != now:
            change = 'worse' if name in worse else 'better' if name in better else ''
            rows.append((heading(name), was, now, change))
    return rows
