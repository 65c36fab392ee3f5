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

"""Recordings read, evaluated, searched and reported, and what tuning brings.

:func:`measure_tuning` gives one object (keys of ``python -m benchmarks tune --json``); with
``--part`` only the named keys are there:

``evaluate``
    The figures of :mod:`benchmarks.tune.evaluation_speed`.
``read``
    The figures of :mod:`benchmarks.tune.reading_speed` for an MCAP file.
``search``
    The figures of :mod:`benchmarks.tune.search_speed`.
``report``
    The figures of :mod:`benchmarks.tune.report_size`.
``families``
    The figures of :mod:`benchmarks.tune.families`, ``by_name`` of the family; ``better``: in how
    many families latency, time ON without slip and recall are all three better.
``sensor``
    The figures of :mod:`benchmarks.tune.new_sensor`.
``onset``
    The figures of :mod:`benchmarks.tune.onset`.
``wanted``
    For each claim, by ``part.figure``: the measured ``value``, the ``bound`` as text and whether
    it is ``met``; both are null where it was not measured, and ``met`` with ``--quick``, which is
    too short to be judged.
"""

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from benchmarks.measurement import Measurement, heading, machine, shared_options
from benchmarks.tune.evaluation_speed import measure_evaluation
from benchmarks.tune.families import measure_families
from benchmarks.tune.new_sensor import measure_new_sensor
from benchmarks.tune.onset import measure_onset
from benchmarks.tune.reading_speed import measure_reading, write_labelled_noise
from benchmarks.tune.report_size import measure_report
from benchmarks.tune.search_speed import measure_search
from benchmarks.verdicts import values_of, verdict_in_words, verdicts
from slip_detector.evaluation.figures import Bound
from slip_detector.report.tables import number_text, text_table

#: Each wanted figure, by ``part.figure``: what it is, and its bound.
WANTED = {
    'evaluate.ratio': ('evaluating an hour from npz, against copy and threshold', Bound(high=4.0)),
    'read.times_real_time': ('reading an hour of MCAP, times real time', Bound(low=200.0)),
    'search.speedup': ('a search, times faster than around SciPy and NumPy', Bound(low=10.0)),
    'report.bytes': ('report of an hour, bytes', Bound(high=10e6, strict=True)),
    'report.ready_ms': ('report of an hour, until it is drawn [ms]', Bound(high=3000.0)),
    'families.better': ('families better in latency, time ON and recall', Bound(low=4.0)),
    'sensor.total_s': ('a new sensor, until its configuration is there [s]', Bound(high=120.0)),
    'onset.mean_delay_ms': ('onset.yaml, mean delay on the plates [ms]', Bound(high=15.0)),
    'onset.detected_percent': ('onset.yaml, slides detected [%]', Bound(low=100.0)),
    'onset.false_time_percent': (
        'onset.yaml, ON while a plate is at rest [% of the time]',
        Bound(high=0.01),
    ),
    'onset.taps_percent': ('onset.yaml, ON in taps [% of the time]', Bound(high=0.05)),
    'onset.rolling_percent': ('onset.yaml, ON in rolling [% of the time]', Bound(high=0.05)),
    'onset.fast_detected_percent': (
        'onset.yaml, slides at 40 and 80 mm/s detected [%]',
        Bound(low=100.0),
    ),
}


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'tune',
        'Measure what evaluating and reading an hour costs, a search against the same around '
        'SciPy and NumPy, and the report of an hour; then what tuning brings on families of '
        'simulated scenes and on a new sensor, and how soon and clean config/onset.yaml is. Says '
        'of each figure what is wanted and whether it is met; the exit code is 0 either way.',
    )
    parser.add_argument(
        '--part', action='append', default=[], choices=MEASURES, help='only this one; repeatable'
    )
    return parser


def run(words: argparse.Namespace) -> Measurement:
    """Measure reading, evaluation, search and report, and what tuning brings."""
    figures: dict[str, Any] = {'machine': machine(), 'quick': words.quick}
    parts = {part: MEASURES[part](words.quick) for part in words.part or MEASURES}
    bounds = {claim: bound for claim, (_, bound) in WANTED.items()}
    wanted = verdicts(bounds, values_of(bounds, parts), judged=not words.quick)
    rows = [('What', 'measured', 'wanted', '')] + [
        (
            WANTED[claim][0],
            number_text(entry['value'], '.4g'),
            entry['bound'],
            verdict_in_words(entry),
        )
        for claim, entry in wanted.items()
    ]
    tables = heading(figures), text_table(rows, '<>><', indent=0), yaml.safe_dump(parts)
    return Measurement({**figures, **parts, 'wanted': wanted}, '\n\n'.join(tables))


def _read(quick: bool) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'hour.mcap'
        write_labelled_noise(path, 30.0 if quick else 3600.0)
        return measure_reading(path)


def _families(quick: bool) -> dict[str, Any]:
    by_name = measure_families(4, range(2), range(2, 3)) if quick else measure_families()
    return {'by_name': by_name, 'better': sum(one['better'] for one in by_name.values())}


def _either(measure: Callable[..., dict[str, Any]], *little: Any) -> Callable[..., dict[str, Any]]:
    """Return what measures little if it is to be quick."""
    return lambda quick: measure(*little) if quick else measure()


MEASURES: dict[str, Callable[[bool], dict[str, Any]]] = {
    'evaluate': _either(measure_evaluation, 20_000, 2),
    'read': _read,
    'search': _either(measure_search, 4, 0.5),
    'report': _either(measure_report, 30.0),
    'families': _families,
    'sensor': _either(measure_new_sensor, 4, range(6400, 6401), 20.0, 12.0),
    'onset': _either(measure_onset, range(6000, 6001)),
}
