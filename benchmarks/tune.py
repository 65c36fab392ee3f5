"""Recordings read, evaluated, searched and reported, and what tuning brings.

:func:`measure` gives one object (keys of ``slip_benchmark tune --json``); ``--part`` leaves out
what it does not name:

``evaluate``
    As :mod:`benchmarks.evaluation_speed` has it.
``read``
    As :mod:`benchmarks.recordings` has it, of an MCAP file.
``search``
    As :mod:`benchmarks.search_speed` has it.
``report``
    As :mod:`benchmarks.report_size` has it.
``families``, ``real``
    As :mod:`benchmarks.families` has them; ``families`` by the name of the family
    under ``by_name``, with ``better``, in how many of them latency and false alarms are better.
``wanted``
    For each claim, by ``part.figure``: the measured ``value``, the ``bound`` as text and whether
    it is ``met``; value and met are null where it was not measured, met with ``--quick`` too: so
    small a measurement is not judged.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.command import Bound, verdict_words, verdicts

#: What is measured unless it is asked for something else; ``real`` needs recordings.
PARTS = ('evaluate', 'read', 'search', 'report', 'families', 'real')

WANTED = {
    'evaluate.ratio': Bound('<=', 4.0),
    'read.times_real_time': Bound('>=', 200.0),
    'search.speedup': Bound('>=', 8.0),
    'report.bytes': Bound('<', 10e6),
    'report.ready_ms': Bound('<=', 3000.0),
    'families.better': Bound('>=', 3.0),
    'real.least_auc_moving': Bound('>=', 0.90),
}

MEANINGS = {
    'evaluate.ratio': 'evaluating an hour from npz, against copy and threshold',
    'read.times_real_time': 'reading an hour of MCAP, times real time',
    'search.speedup': 'a search, times faster than around SciPy and NumPy',
    'report.bytes': 'report of an hour, bytes',
    'report.ready_ms': 'report of an hour, until it is drawn [ms]',
    'families.better': 'families with better latency and fewer false alarms',
    'real.least_auc_moving': 'real recordings left out, AUC against motion, worst seed',
}

#: Searches on the real recordings, each with the next seed.
REAL_SEEDS = 5


def measure(
    quick: bool = False,
    parts: Sequence[str] = (),
    recordings: Path | None = None,
    config: Path | None = None,
) -> dict[str, Any]:
    """Measure; the keys are in the module's docstring.

    Parameters
    ----------
    quick
        Small and rough, for tests.
    parts
        Of :data:`PARTS`; none: all, ``real`` where there are recordings.
    recordings, config
        A folder of labelled recordings and the parameters to begin with.

    Raises
    ------
    ValueError
        For an unknown part, or ``real`` without recordings and parameters.
    """
    for part in parts:
        if part not in PARTS:
            raise ValueError(f'--part is {part!r}, allowed: {", ".join(PARTS)}')
    if ('real' in parts or recordings) and not (recordings and config):
        raise ValueError('real recordings need --recordings and --config')
    chosen = parts or [part for part in PARTS if part != 'real' or recordings]
    result: dict[str, Any] = {}
    for part in chosen:
        if part == 'real':
            from benchmarks import families

            assert recordings is not None
            assert config is not None
            seeds, trials = (range(1), 4) if quick else (range(REAL_SEEDS), families.REAL_TRIALS)
            result['real'] = families.real(recordings, config, seeds, trials)
        else:
            result[part] = _MEASURES[part](quick)
    values = {
        claim: result.get(part, {}).get(figure)
        for claim in WANTED
        for part, figure in [claim.split('.')]
    }
    result['wanted'] = verdicts(WANTED, values, judged=not quick)
    return result


def _evaluate(quick: bool) -> dict[str, Any]:
    from benchmarks import evaluation_speed

    return evaluation_speed.measure(20_000, 2) if quick else evaluation_speed.measure()


def _read(quick: bool) -> dict[str, Any]:
    from benchmarks.recordings import hour_of_mcap, reading

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'hour.mcap'
        hour_of_mcap(path, 30.0 if quick else 3600.0)
        return reading(path)


def _search(quick: bool) -> dict[str, Any]:
    from benchmarks import search_speed

    return search_speed.measure(4, 0.5) if quick else search_speed.measure()


def _report(quick: bool) -> dict[str, Any]:
    from benchmarks import report_size

    return report_size.measure(30.0) if quick else report_size.measure()


def _families(quick: bool) -> dict[str, Any]:
    from benchmarks import families

    by_name = families.families(4, range(2), range(2, 3)) if quick else families.families()
    return {'by_name': by_name, 'better': sum(one['better'] for one in by_name.values())}


_MEASURES = {
    'evaluate': _evaluate,
    'read': _read,
    'search': _search,
    'report': _report,
    'families': _families,
}


def table(result: dict[str, Any]) -> str:
    """Lay the figures out as text."""
    lines = ['What                                                      measured    wanted']
    for claim, entry in result['wanted'].items():
        value = '-' if entry['value'] is None else f'{entry["value"]:.4g}'
        met = verdict_words(entry)
        lines.append(f'{MEANINGS[claim]:<56}  {value:>8}  {entry["bound"]:>8}  {met}'.rstrip())
    if 'families' in result:
        lines += [
            '',
            'Held-out seeds, given -> tuned: latency of all and of those detected [ms], '
            'false alarms a minute, recall',
        ]
        for name, one in result['families']['by_name'].items():
            both = ' -> '.join(_in_short(one[which]) for which in ('given', 'tuned'))
            lines.append(f'  {name:<32} {both}' + (f' ({one["kept"]})' if one['kept'] else ''))
    if 'real' in result:
        real = result['real']
        lines += ['', f'Real recordings, {real["recordings"]}, each left out of its search:']
        rows = {'as given': real['given'], **{f'seed {k}': v for k, v in real['seeds'].items()}}
        for name, one in rows.items():
            lines.append(
                f'  {name:<9} AUC against motion {one["auc_moving"]:.3f} '
                f'(by thresholds {one["auc_moving_by_threshold"]:.3f})'
            )
    return '\n'.join(lines)


def _in_short(figures: dict[str, Any]) -> str:
    shown = [
        '-' if figures[name] is None else f'{figures[name]:.1f}'
        for name in ('latency_median_all_ms', 'latency_median_ms', 'false_alarms_per_minute')
    ]
    return f'{", ".join(shown)}, {figures["recall"]:.2f}'
