"""The paper's protocol: three plates, ten trials on each, and its figures beside ours.

Each trial is a scene of the package, simulated once and run through several chains: the one that
is asked for, the same with other windows (as the paper's Fig. 4) and the same with wider bands
and no stop-band above them (as its Fig. 7). PlateTrial k of each plate has the seed k, so that the
plates differ in nothing but their spatial period.

Of the paper's Table 2 the means and standard deviations of each plate are at hand, its delays of
the single trials are not; of Figs. 4 and 7 what they say, not their values. What is not at hand is
left out.

``slip_evaluate --protocol paper --json`` prints one object:

``seeds``
    Of the trials of each plate.
``scenes``
    By plate, which is named by its spatial period in micrometres (``400``, ``440``, ``480``):
    the scene.
``paper``
    What the paper reports: by plate ``mean_delay_ms`` and ``sd_delay_ms``, and
    ``false_positive_percent``.
``plates``
    By plate: ``trial_delays_ms``, the delay of each trial, which is the mean over its channels
    (Eq. 10) of the time from the last sample at which the plate still stood (Eq. 9) to the
    channel's first ON before the plate stands again; ``mean_delay_ms`` and ``sd_delay_ms`` (n - 1)
    over the trials; ``detected``, the trials whose global decision is ON while the plate moves, of
    ``trials``; ``false_positive_percent``, the share of the time at which the plate stands, of all
    trials together, that the global decision is ON; ``channels_without_on``, how many channels of
    all trials have no such ON and hence no part in the means. null where a figure is not defined.
``all``
    The same figures over the trials of all plates.
``windows``
    By length of both windows in milliseconds (``20``, ``30``, ``40``): ``plates`` and ``all``.
``bands``
    By edges of the band-pass in Hz (``10-100``, ``10-150``), without the stop-bands above the
    configured band: ``plates`` and ``all``.
``wanted``
    For each claim: the ``value`` (null where it is not defined), the ``bound`` as text and whether
    it is ``met``; see :data:`WANTED`.
``plots``
    The pictures that were written.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from slip_detector.evaluation.protocol_trials import (
    BANDS_HZ,
    PAPER_DELAY_MS,
    PAPER_FALSE_POSITIVE_PERCENT,
    SCENES,
    WINDOWS_S,
    PlateTrial,
    band_name,
    evaluate_plates,
    simulate_trials,
    with_band,
    with_windows,
)
from slip_detector.parameters.detector import ChainConfig

#: Trials on each plate (Section 3).
TRIALS = 10


class Bound(NamedTuple):
    """What is wanted of a figure: from ``low`` to ``high``, or above ``low`` where ``above``."""

    low: float = -np.inf
    high: float = np.inf
    above: bool = False

    def met(self, figure: float | None) -> bool:
        """Return whether a figure is as wanted; one that is not defined is not."""
        if figure is None:
            return False
        return (figure > self.low if self.above else figure >= self.low) and figure <= self.high

    def __str__(self) -> str:
        if self.high == np.inf:
            return f'{">" if self.above else ">="} {self.low:g}'
        return f'<= {self.high:g}' if self.low == -np.inf else f'{self.low:.2f} to {self.high:.2f}'


#: What is wanted of the figures that :func:`claims` gives under the same names.
WANTED: dict[str, Bound] = {
    'detected_percent': Bound(low=100.0),
    **{
        f'mean_delay_ms.{plate}': Bound(mean - sd, mean + sd)
        for plate, (mean, sd) in PAPER_DELAY_MS.items()
    },
    'least_rise_ms': Bound(low=0.0, above=True),
    'worst_false_positive_percent': Bound(high=PAPER_FALSE_POSITIVE_PERCENT),
    'windows.20.false_positive_percent_more': Bound(low=0.0, above=True),
    'windows.30.false_positive_percent_more': Bound(low=0.0, above=True),
    'bands.10-100.least_shortening_ms': Bound(low=0.0, above=True),
    'bands.10-150.least_shortening_ms': Bound(low=0.0, above=True),
}

#: The claims in words.
MEANINGS = {
    'detected_percent': 'trials detected [%]',
    **{
        f'mean_delay_ms.{plate}': f'mean delay, {plate} um, within the sd of the paper [ms]'
        for plate in SCENES
    },
    'least_rise_ms': 'least rise of the mean delay from plate to plate [ms]',
    'worst_false_positive_percent': 'false positives, worst plate [% of the time without slip]',
    'windows.20.false_positive_percent_more': 'false positives, windows of 20 ms less 40 ms [%]',
    'windows.30.false_positive_percent_more': 'false positives, windows of 30 ms less 40 ms [%]',
    'bands.10-100.least_shortening_ms': 'delay saved by [10, 100] Hz, least of the plates [ms]',
    'bands.10-150.least_shortening_ms': 'delay saved by [10, 150] Hz, least of the plates [ms]',
}


def evaluate_protocol(
    plates: Mapping[str, Sequence[PlateTrial]], config: ChainConfig
) -> dict[str, Any]:
    """Run trials through the chain and its variants of Figs. 4 and 7.

    Parameters
    ----------
    plates
        The trials by plate; those of :data:`SCENES`.
    config
        The chain's.

    Returns
    -------
    dict
        ``plates``, ``all``, ``windows``, ``bands`` and ``wanted``, as the module's docstring has
        them.

    Raises
    ------
    ValueError
        When a chain cannot be built or a trial does not suit it.
    """
    result: dict[str, Any] = evaluate_plates(plates, config)
    result['windows'] = {
        f'{window_s * 1e3:.0f}': evaluate_plates(plates, with_windows(config, window_s))
        for window_s in WINDOWS_S
    }
    result['bands'] = {
        f'{low:g}-{high:g}': evaluate_plates(plates, with_band(config, (low, high)))
        for low, high in BANDS_HZ
    }
    values = claims(result)
    result['wanted'] = {
        name: {'value': values[name], 'bound': str(bound), 'met': bound.met(values[name])}
        for name, bound in WANTED.items()
    }
    return result


def claims(result: Mapping[str, Any]) -> dict[str, float | None]:
    """Return the figures that :data:`WANTED` bounds; None where one is not defined.

    Parameters
    ----------
    result
        ``plates``, ``all``, ``windows`` and ``bands`` of :func:`evaluate_protocol`.
    """
    plates, whole = result['plates'], result['all']
    means = [plates[plate]['mean_delay_ms'] for plate in SCENES]
    windows, bands = result['windows'], result['bands']
    longest = windows[f'{WINDOWS_S[-1] * 1e3:.0f}']['all']['false_positive_percent']
    values = {
        'detected_percent': 100.0 * whole['detected'] / whole['trials'],
        'least_rise_ms': _defined(min, map(_less, means[1:], means[:-1])),
        'worst_false_positive_percent': _defined(
            max, (plates[plate]['false_positive_percent'] for plate in SCENES)
        ),
    }
    for plate, mean in zip(SCENES, means, strict=True):
        values[f'mean_delay_ms.{plate}'] = mean
    for name, part in windows.items():
        more = _less(part['all']['false_positive_percent'], longest)
        values[f'windows.{name}.false_positive_percent_more'] = more
    for name, part in bands.items():
        shorter = [part['plates'][plate]['mean_delay_ms'] for plate in SCENES]
        values[f'bands.{name}.least_shortening_ms'] = _defined(min, map(_less, means, shorter))
    return values


def _less(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a - b


def _defined(pick: Callable[[list[float]], float], values: Iterable[float | None]) -> float | None:
    """Return the least or the most of the values; None where one of them is not defined."""
    known: list[float] = []
    for value in values:
        if value is None:
            return None
        known.append(value)
    return pick(known)


def run(
    config: ChainConfig,
    trials: int = TRIALS,
    seed: int = 0,
    draw: Callable[..., Sequence[Path]] | None = None,
) -> dict[str, Any]:
    """Simulate the paper's protocol and evaluate it.

    Parameters
    ----------
    config
        The chain's.
    trials
        On each plate.
    seed
        Of the first trial; the next have the next.
    draw
        Draws the pictures, given the trials by plate, the chain's parameters and the figures, and
        returns their paths; none are drawn without.

    Returns
    -------
    dict
        As the module's docstring has it.

    Raises
    ------
    ValueError
        When the chain cannot be built, does not suit the scenes, or a picture cannot be written.
    """
    seeds = list(range(seed, seed + trials))
    plates = {plate: simulate_trials(scene, seeds) for plate, scene in SCENES.items()}
    result = {
        'seeds': seeds,
        'scenes': dict(SCENES),
        'paper': {
            'plates': {
                plate: {'mean_delay_ms': mean, 'sd_delay_ms': sd}
                for plate, (mean, sd) in PAPER_DELAY_MS.items()
            },
            'false_positive_percent': PAPER_FALSE_POSITIVE_PERCENT,
        },
        **evaluate_protocol(plates, config),
    }
    written = [] if draw is None else draw(plates, config, result)
    return {**result, 'plots': [str(path) for path in written]}


def table(result: Mapping[str, Any]) -> str:
    """Lay the figures out as text, the paper's beside ours, what is wanted at the end."""
    plates, paper = result['plates'], result['paper']
    seeds = result['seeds']
    heads = ['', *(f'{plate} um' for plate in plates), 'all']
    columns = [*plates.values(), result['all']]

    def row(head: str, key: str, form: str = '.2f') -> list[str]:
        return [head, *(_cell(column[key], form) for column in columns)]

    def paper_row(head: str, key: str) -> list[str]:
        return [head, *(_cell(paper['plates'][plate][key], '.2f') for plate in plates), '']

    lines = [
        f"The paper's protocol: {len(plates)} plates, {len(seeds)} trials on each, "
        f'seeds {seeds[0]} to {seeds[-1]}',
        'Delay [ms] from the start of the plate to the first ON, mean over the channels (Eq. 10)',
        '',
    ]
    trials = [
        [f'seed {seed}', *(_cell(plates[plate]['trial_delays_ms'][k], '.2f') for plate in plates)]
        for k, seed in enumerate(seeds)
    ]
    lines += _aligned(
        [
            heads,
            *([*line, ''] for line in trials),
            row('mean', 'mean_delay_ms'),
            paper_row('mean, paper', 'mean_delay_ms'),
            row('sd', 'sd_delay_ms'),
            paper_row('sd, paper', 'sd_delay_ms'),
            ['detected', *(_of(column) for column in columns)],
            ['success [%]', *(f'{_success_percent(column):.1f}' for column in columns)],
            row('false positives [%]', 'false_positive_percent'),
            [
                'false positives, paper [%]',
                *([''] * len(plates)),
                f'{paper["false_positive_percent"]:.2f}',
            ],
            row('channels without ON', 'channels_without_on', 'd'),
        ]
    )
    lines += [
        '',
        "False positives: share of the time at which the plate stands. The paper's delays of the "
        'single trials are not at hand.',
    ]
    heads = ['', *(f'{plate} um' for plate in plates), 'detected', 'false positives [%]']
    windows = [_variant(f'{name} ms', part) for name, part in result['windows'].items()]
    lines += ['', 'Mean delay [ms] by the length of both windows (as Fig. 4)', '']
    lines += _aligned([heads, *windows])
    bands = [_variant('as configured', result)]
    bands += [_variant(band_name(name), part) for name, part in result['bands'].items()]
    lines += ['', 'Mean delay [ms] by band (as Fig. 7)', '']
    lines += _aligned([heads, *bands])
    lines += ['', 'Wanted', '']
    lines += _aligned(
        [
            [
                MEANINGS[name],
                _cell(entry['value'], '.2f'),
                f'wanted {entry["bound"]}',
                'met' if entry['met'] else 'NOT met',
            ]
            for name, entry in result['wanted'].items()
        ]
    )
    if result['plots']:
        lines += ['', f'Written: {", ".join(result["plots"])}']
    return '\n'.join(lines)


def _variant(head: str, part: Mapping[str, Any]) -> list[str]:
    means = [_cell(mine['mean_delay_ms'], '.2f') for mine in part['plates'].values()]
    false_percent = _cell(part['all']['false_positive_percent'], '.2f')
    return [head, *means, _of(part['all']), false_percent]


def _success_percent(part: Mapping[str, Any]) -> float:
    return float(100.0 * part['detected'] / part['trials'])


def _of(part: Mapping[str, Any]) -> str:
    return f'{part["detected"]} of {part["trials"]}'


def _cell(value: float | None, form: str) -> str:
    return '-' if value is None else format(value, form)


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lay rows of text out in columns, the first to the left and the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        '  '.join(['', first.ljust(widths[0]), *map(str.rjust, rest, widths[1:])]).rstrip()
        for first, *rest in rows
    ]
