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
``jobs``
    The figures of :mod:`benchmarks.tune.jobs_speed`.
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

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.tune.evaluation_speed import measure_evaluation
from benchmarks.tune.families import measure_families
from benchmarks.tune.jobs_speed import measure_jobs
from benchmarks.tune.new_sensor import measure_new_sensor
from benchmarks.tune.onset import measure_onset
from benchmarks.tune.reading_speed import measure_reading, write_labelled_noise
from benchmarks.tune.report_size import measure_report
from benchmarks.tune.search_speed import measure_search
from benchmarks.verdicts import values_of, verdicts
from slip_detector.evaluation.figures import Bound

PARTS = ('evaluate', 'read', 'jobs', 'search', 'report', 'families', 'sensor', 'onset')

WANTED = {
    'evaluate.ratio': Bound(high=4.0),
    'read.times_real_time': Bound(low=200.0),
    'search.speedup': Bound(low=10.0),
    'report.bytes': Bound(high=10e6, strict=True),
    'report.ready_ms': Bound(high=3000.0),
    'families.better': Bound(low=4.0),
    'sensor.total_s': Bound(high=120.0),
    'onset.mean_delay_ms': Bound(high=15.0),
    'onset.detected_percent': Bound(low=100.0),
    'onset.false_time_percent': Bound(high=0.01),
    'onset.taps_percent': Bound(high=0.05),
    'onset.rolling_percent': Bound(high=0.05),
    'onset.fast_detected_percent': Bound(low=100.0),
}


def measure_tuning(quick: bool = False, parts: Sequence[str] = ()) -> dict[str, Any]:
    """Measure what it costs to tune and what it brings; the keys are in the module's docstring.

    Parameters
    ----------
    quick
        Measure little, and judge nothing.
    parts
        Some of :data:`PARTS`; without any all are measured.

    Raises
    ------
    ValueError
        For an unknown part.
    """
    for part in parts:
        if part not in PARTS:
            raise ValueError(f'--part is {part!r}, allowed: {", ".join(PARTS)}')
    result: dict[str, Any] = {part: _MEASURES[part](quick) for part in parts or PARTS}
    result['wanted'] = verdicts(WANTED, values_of(WANTED, result), judged=not quick)
    return result


def _evaluate(quick: bool) -> dict[str, Any]:
    return measure_evaluation(20_000, 2) if quick else measure_evaluation()


def _read(quick: bool) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'hour.mcap'
        write_labelled_noise(path, 30.0 if quick else 3600.0)
        return measure_reading(path)


def _jobs(quick: bool) -> dict[str, Any]:
    return measure_jobs(2, 0.2, 1) if quick else measure_jobs()


def _search(quick: bool) -> dict[str, Any]:
    return measure_search(4, 0.5) if quick else measure_search()


def _report(quick: bool) -> dict[str, Any]:
    return measure_report(30.0) if quick else measure_report()


def _families(quick: bool) -> dict[str, Any]:
    by_name = measure_families(4, range(2), range(2, 3)) if quick else measure_families()
    return {'by_name': by_name, 'better': sum(one['better'] for one in by_name.values())}


def _sensor(quick: bool) -> dict[str, Any]:
    return measure_new_sensor(4, range(6400, 6401), 20.0, 12.0) if quick else measure_new_sensor()


def _onset(quick: bool) -> dict[str, Any]:
    return measure_onset(range(6000, 6001)) if quick else measure_onset()


_MEASURES = {
    'evaluate': _evaluate,
    'read': _read,
    'jobs': _jobs,
    'search': _search,
    'report': _report,
    'families': _families,
    'sensor': _sensor,
    'onset': _onset,
}
