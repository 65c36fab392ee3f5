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

"""Encodes the volts, levels and decisions of overviews for a report.

For each recording the timeline reads a header, which is JSON, and one string of bytes, compressed
and in base64. Bins are merged until all fit, so that a report of long recordings stays small.
Single rows are kept near events, first near false alarms, then near missed and late slips.

The bytes are, in the order in which ``templates/report_data.js`` reads them:

- the lowest volts of each bin as 16-bit codes, channel after channel, each as its difference from
  the bin before; then, in the same order, the highest volts minus the lowest;
- starts and ends of true slips, each as its difference from the number before;
- for each variant: the codes of the levels, channel after channel, and with evidence those of
  excess and floor; the intervals of the global decision, of each group and after impacts; the
  volts and the same codes of each snippet.

Numbers of several bytes are written in planes: all lowest bytes, then all second bytes, and so on,
as slow signals compress better in this order. A signed difference d is written as 2 d, or as
-2 d - 1 where it is negative.
"""

import base64
import zlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.overview import (
    EVENT_KINDS,
    Event,
    Overview,
    RowNumbers,
    Snippet,
    Volts,
)
from slip_detector.report.signal_codes import ranges_db, signals_of

#: Limits of a whole report: bins times channels, and rows of snippets times channels.
MOST_BIN_CELLS, MOST_SNIPPET_CELLS = 2**20, 3 * 2**19

#: Where one decision has more intervals than this, those less than a bin apart are joined.
MOST_INTERVALS = 20_000

#: The golden ratio less 1: its first n multiples, modulo 1, spread evenly over 0 to 1 for any n.
GOLDEN = 0.5 * 5**0.5 - 0.5

#: Code of a bin without samples, and the highest code of a channel's range. Finer steps would make
#: the file larger and would not be seen: a channel has some 40 pixels in the timeline.
NO_SAMPLE, MOST_CODE = 0xFFFF, 2**14 - 1


class Variant(NamedTuple):
    """One configuration of the chain, with its overviews and figures of all recordings.

    Attributes
    ----------
    name : str
        For example ``given`` or ``tuned``.
    config : ChainConfig
    overviews : sequence of Overview
        One for each recording, in the same order for all variants.
    figures : mapping
        Figures of each recording, and of all together, by its name. Each figure is a number or a
        text by its own name, or None where it is not defined.

    Examples
    --------
    >>> given = Variant('given', ChainConfig(), [], {'all recordings': {'recall': 0.95}})
    >>> given.figures['all recordings']['recall']
    0.95
    """

    name: str
    config: ChainConfig
    overviews: Sequence[Overview]
    figures: Mapping[str, Mapping[str, float | str | None]]


class SearchTrial(NamedTuple):
    """One configuration that a search tried.

    Attributes
    ----------
    number : int or None
        Number of the trial; None for a configuration that is shown beside the trials.
    latency_s, false_alarms_per_minute, false_time_percent, sooner_than_chance : float or None
        None where a figure is not defined.
    parameters : mapping
        The parameters that were tried, by name.
    mark : str
        A word that marks the point, for example ``given`` or ``tuned``; empty for most trials.

    Examples
    --------
    >>> SearchTrial(3, 0.04, 2.0, false_time_percent=0.1, sooner_than_chance=0.75).costs
    (0.04, 2.0, 0.1, 0.25)
    """

    number: int | None
    latency_s: float | None
    false_alarms_per_minute: float | None
    false_time_percent: float | None
    sooner_than_chance: float | None
    parameters: Mapping[str, Any] = {}
    mark: str = ''

    @property
    def costs(self) -> tuple[float, float, float, float] | None:
        """Latency, false alarms, false time and 1 less sooner than chance; smaller is better.

        None where one is not defined.
        """
        if (
            self.latency_s is None
            or self.false_alarms_per_minute is None
            or self.false_time_percent is None
            or self.sooner_than_chance is None
        ):
            return None
        return (
            self.latency_s,
            self.false_alarms_per_minute,
            self.false_time_percent,
            1.0 - self.sooner_than_chance,
        )


def trade_off_front(trials: Sequence[SearchTrial]) -> list[SearchTrial]:
    """Return the trials of the Pareto front, the one with the shortest latency first.

    A trial is on the front when no other one is as good in all costs and better in one. Trials
    with a cost that is not defined are left out.

    Examples
    --------
    >>> trials = [SearchTrial(0, 0.05, 4.0, 0.1, 1.0), SearchTrial(1, 0.03, 9.0, 0.1, 1.0),
    ...           SearchTrial(2, 0.06, 9.0, 0.1, 0.95)]
    >>> [trial.number for trial in trade_off_front(trials)]
    [1, 0]
    """
    known = [(trial.costs, trial) for trial in trials if trial.costs is not None]
    costs = np.array([costs for costs, _ in known]).reshape(-1, 4)
    best = [
        (own, trial)
        for own, trial in known
        if not np.any(np.all(costs <= own, axis=1) & np.any(costs < own, axis=1))
    ]
    return [trial for _, trial in sorted(best, key=lambda pair: pair[0])]


def bin_rows(recordings: Sequence[Sequence[Overview]]) -> list[int]:
    """Return how many rows a bin has in each recording so that all fit into one report.

    Examples
    --------
    >>> bin_rows([[Overview('trial', ChainConfig(), most_cells=16 * 64)]])
    [1]
    """
    sizes = [max(overview.bin_rows for overview in variants) for variants in recordings]
    cells = [
        -(-variants[0].rows // size) * variants[0].config.channels
        for variants, size in zip(recordings, sizes, strict=True)
    ]
    while sum(cells) > MOST_BIN_CELLS:
        largest = int(np.argmax(cells))
        sizes[largest] *= 2
        cells[largest] = -(-cells[largest] // 2)
    return sizes


def choose_snippets(recordings: Sequence[Sequence[Overview]]) -> list[list[list[Snippet]]]:
    """Choose the snippets that fit into a report, for each recording and variant, in order.

    Snippets with an event of the first kind in :data:`EVENT_KINDS` are chosen first, then those of
    the next kind. Within a kind they are spread over the whole length of each recording.
    """
    candidates = [
        (_rank(snippet, overview), i * GOLDEN % 1.0, r, v, snippet)
        for r, variants in enumerate(recordings)
        for v, overview in enumerate(variants)
        for i, snippet in enumerate(overview.snippets)
    ]
    candidates.sort(key=lambda candidate: candidate[:4])
    chosen: list[list[list[Snippet]]] = [[[] for _ in variants] for variants in recordings]
    room = MOST_SNIPPET_CELLS
    for _, _, r, v, snippet in candidates:
        if snippet.codes.size <= room:
            room -= snippet.codes.size
            chosen[r][v].append(snippet)
    for variants in chosen:
        for snippets in variants:
            snippets.sort(key=lambda snippet: snippet.start)
    return chosen


def _rank(snippet: Snippet, overview: Overview) -> int:
    rate = overview.sample_rate_hz
    stop = snippet.start + len(snippet.codes)
    shown = [
        EVENT_KINDS.index(event.kind)
        for event in overview.events
        if snippet.start <= round(event.start_s * rate) < stop
    ]
    return min(shown, default=len(EVENT_KINDS))


def pack_recording(
    variants: Sequence[Overview], rows_of_bin: int, snippets: Sequence[Sequence[Snippet]]
) -> tuple[dict[str, Any], str]:
    """Return the header and the data of one recording.

    Parameters
    ----------
    variants
        The overviews of the recording, one for each variant.
    rows_of_bin
        Rows in a bin, from :func:`bin_rows`.
    snippets
        For each variant the snippets to write.

    Returns
    -------
    header : dict
        What is needed to read the data, and the events, in types of JSON.
    data : str
        The bytes, compressed with zlib, in base64.

    Examples
    --------
    >>> header, data = pack_recording([Overview('rest', ChainConfig())], 1, [[]])
    >>> header['name'], header['rows'], len(header['channels'])
    ('rest', 0, 16)
    """
    first = variants[0]
    low, high, _ = first.bins(rows_of_bin)
    lowest, step = _scale(low, high)
    codes = _as_codes(low, lowest, step)
    span = np.where(codes == NO_SAMPLE, 0, _as_codes(high, lowest, step) - codes)
    truth = None if first.truth is None else _joined(first.truth, rows_of_bin)
    parts = [
        _differences(codes),
        _planes(span.astype(np.uint16).T),
        b'' if truth is None else _intervals(truth),
    ]
    header: dict[str, Any] = {
        'name': first.name,
        'rate_hz': first.sample_rate_hz,
        'rows': first.rows,
        'bin_rows': rows_of_bin,
        'bins': len(low),
        'channels': first.channel_names,
        'lowest_v': lowest.tolist(),
        'step_v': step.tolist(),
        'truth': None if truth is None else len(truth),
        'variants': [],
    }
    for overview, chosen in zip(variants, snippets, strict=True):
        slip = _joined(overview.slip, rows_of_bin)
        groups = {name: _joined(on, rows_of_bin) for name, on in overview.groups.items()}
        parts += [overview.bins(rows_of_bin)[2].T.tobytes(), _intervals(slip)]
        after_impact = _joined(overview.after_impact, rows_of_bin)
        parts += [_intervals(on) for on in (*groups.values(), after_impact)]
        for snippet in chosen:
            parts += [
                _differences(_as_codes(snippet.volts, lowest, step)),
                snippet.codes.T.tobytes(),
            ]
        header['variants'].append(
            {
                'slip': len(slip),
                'after_impact': len(after_impact),
                'signals': signals_of(overview.config),
                **_decibels(overview.config),
                'groups': [
                    {'name': name, 'members': members, 'intervals': len(groups[name])}
                    for name, members in overview.config.groups.items()
                ],
                'snippets': [[snippet.start, len(snippet.codes)] for snippet in chosen],
                'events': [_event(event) for event in overview.events],
            }
        )
    return header, base64.b64encode(zlib.compress(b''.join(parts))).decode()


def _decibels(config: ChainConfig) -> dict[str, Any]:
    """Return the ranges with which the page reads the codes of floor and excess."""
    if config.decision != 'evidence':
        return {}
    return {'ranges_db': ranges_db(config), 'offset_db': config.evidence_offset_db}


def _event(event: Event) -> list[Any]:
    # Microseconds are finer than any sample.
    times = [None if t is None else round(t, 6) for t in event[1:4]]
    parts = {name: round(t, 6) for name, t in event.parts.items()}
    return [EVENT_KINDS.index(event.kind), *times, parts, event.note]


def _scale(low: Volts, high: Volts) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest volts of each channel and the volts of one step of its codes."""
    lowest = np.fmin.reduce(low, axis=0, initial=np.inf).astype(np.float64)
    highest = np.fmax.reduce(high, axis=0, initial=-np.inf).astype(np.float64)
    none = lowest > highest  # a channel that has no sample
    lowest[none] = highest[none] = 0.0
    step = (highest - lowest) / MOST_CODE
    # A flat channel has one code only, with any step.
    return lowest, np.where(step > 0.0, step, 1.0)


def _as_codes(
    volts: Volts, lowest: NDArray[np.float64], step: NDArray[np.float64]
) -> NDArray[np.int64]:
    codes = (volts.astype(np.float64) - lowest) / step
    rounded = np.rint(np.nan_to_num(codes)).clip(0, MOST_CODE)
    return np.where(np.isnan(codes), NO_SAMPLE, rounded).astype(np.int64)


def _differences(codes: NDArray[np.int64]) -> bytes:
    """Return columns of codes one after another, each value as its step from the one before."""
    steps = np.diff(codes.T, axis=1, prepend=0).astype(np.int16)  # modulo 2**16
    return _planes(((steps << 1) ^ (steps >> 15)).view(np.uint16))


def _planes(values: NDArray[Any]) -> bytes:
    """Return all lowest bytes, then all second bytes, and so on."""
    little = np.ascontiguousarray(values, values.dtype.newbyteorder('<'))
    planes = little.reshape(-1).view(np.uint8).reshape(-1, values.dtype.itemsize).T
    return bytes(planes.tobytes())


def _intervals(pairs: RowNumbers) -> bytes:
    return _planes(np.diff(pairs.reshape(-1), prepend=0).astype(np.uint64))


def _joined(pairs: RowNumbers, rows_of_bin: int) -> RowNumbers:
    """Join intervals that are less than a bin apart where there are too many to draw."""
    if len(pairs) <= MOST_INTERVALS:
        return pairs
    apart = pairs[1:, 0] - pairs[:-1, 1] > rows_of_bin
    starts = pairs[np.concatenate([[True], apart]), 0]
    stops = pairs[np.concatenate([apart, [True]]), 1]
    return np.column_stack([starts, stops])
