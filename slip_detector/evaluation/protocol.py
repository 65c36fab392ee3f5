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

"""The paper's protocol: three plates, ten trials on each, and its figures beside ours.

Each trial is a scene of the package, simulated once and run through several chains: the given one,
the same with other windows (as in the paper's Fig. 4) and the same with wider bands and no
stop-band above them (as in its Fig. 7). Trial k of each plate has the seed k, so that the plates
differ only in their spatial period.

The paper gives the means and standard deviations of each plate (Table 2), but not the delays of
single trials, and Figs. 4 and 7 without their values. What the paper does not give is left out.

``slip_evaluate --protocol paper --json`` prints one object:

``seeds``
    The seeds of the trials of each plate.
``scenes``
    The scene of each plate. A plate is named by its spatial period in micrometres (``400``,
    ``440``, ``480``).
``paper``
    What the paper reports: ``mean_delay_ms`` and ``sd_delay_ms`` of each plate under ``plates``,
    and ``false_positive_percent``.
``plates``
    For each plate: ``trial_delays_ms``, the delay of each trial. It is the mean over the channels
    (Eq. 10) of the time from the last sample at which the plate still stood (Eq. 9) to the first
    ON of the channel before the plate stands again. ``mean_delay_ms`` and ``sd_delay_ms`` (n - 1)
    of the trials; ``detected``, the number of trials whose global decision is ON while the plate
    moves, out of ``trials``, and ``success_percent``, their share; ``false_positive_percent``, the
    share of the time at which the plate stands in which the global decision is ON;
    ``channels_without_on``, how many channels in all trials have no such ON and are left out of
    the means. A figure that is not defined is null.
``all``
    The same figures over the trials of all plates.
``windows``
    ``plates`` and ``all`` by the length of both windows in milliseconds (``20``, ``30``, ``40``).
``bands``
    ``plates`` and ``all`` by the edges of the band-pass in Hz (``10-100``, ``10-150``), without
    the stop-bands above the configured band.
``wanted``
    For each wanted figure its ``value`` (null where it is not defined), the ``bound`` as text, and
    whether it is ``met``; see :data:`WANTED`.
``plots``
    The pictures that were written.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from slip_detector.evaluation.bounds import Bound
from slip_detector.evaluation.protocol_trials import (
    BANDS_HZ,
    PAPER_DELAY_MS,
    PAPER_FALSE_POSITIVE_PERCENT,
    SCENES,
    WINDOWS_S,
    PlateTrial,
    evaluate_plates,
    simulate_trials,
    with_band,
    with_windows,
)
from slip_detector.parameters.detector import ChainConfig

#: Trials on each plate (Section 3).
TRIALS = 10


#: Bounds of the figures that :func:`claims` returns under the same names.
WANTED: dict[str, Bound] = {
    'detected_percent': Bound(low=100.0),
    **{
        f'mean_delay_ms.{plate}': Bound(mean - sd, mean + sd)
        for plate, (mean, sd) in PAPER_DELAY_MS.items()
    },
    'least_rise_ms': Bound(low=0.0, strict=True),
    'worst_false_positive_percent': Bound(high=PAPER_FALSE_POSITIVE_PERCENT),
    'windows.20.false_positive_percent_more': Bound(low=0.0, strict=True),
    'windows.30.false_positive_percent_more': Bound(low=0.0, strict=True),
    'bands.10-100.least_shortening_ms': Bound(low=0.0, strict=True),
    'bands.10-150.least_shortening_ms': Bound(low=0.0, strict=True),
}


def evaluate_protocol(
    plates: Mapping[str, Sequence[PlateTrial]], config: ChainConfig
) -> dict[str, Any]:
    """Run trials through the chain and its variants of Figs. 4 and 7.

    Parameters
    ----------
    plates
        The trials of each plate in :data:`SCENES`.
    config
        The parameters of the chain.

    Returns
    -------
    dict
        ``plates``, ``all``, ``windows``, ``bands`` and ``wanted``; see the module's docstring.

    Raises
    ------
    ValueError
        When a chain cannot be built or a trial does not suit it.

    Examples
    --------
    >>> from slip_detector.evaluation.protocol_trials import simulate_trials
    >>> trials = {plate: simulate_trials(scene, [0]) for plate, scene in SCENES.items()}
    >>> result = evaluate_protocol(trials, ChainConfig())
    >>> result['all']['detected'], list(result['windows'])
    (3, ['20', '30', '40'])
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
        ``plates``, ``all``, ``windows`` and ``bands`` as :func:`evaluate_protocol` returns them.
    """
    plates, whole = result['plates'], result['all']
    means = [plates[plate]['mean_delay_ms'] for plate in SCENES]
    windows, bands = result['windows'], result['bands']
    longest = windows[f'{WINDOWS_S[-1] * 1e3:.0f}']['all']['false_positive_percent']
    values: dict[str, float | None] = {
        'detected_percent': whole['success_percent'],
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
    """Return the smallest or largest value; None where one of them is not defined."""
    known: list[float] = []
    for value in values:
        if value is None:
            return None
        known.append(value)
    return pick(known)


def run_protocol(
    config: ChainConfig,
    trials: int = TRIALS,
    seed: int = 0,
    draw: Callable[..., Sequence[Path]] | None = None,
) -> dict[str, Any]:
    """Simulate the paper's protocol and evaluate it.

    Parameters
    ----------
    config
        The parameters of the chain.
    trials
        Number of trials on each plate.
    seed
        Seed of the first trial; the following trials have the following seeds.
    draw
        Draws the pictures and returns their paths, given the trials by plate, the parameters of
        the chain and the figures. None: no pictures.

    Returns
    -------
    dict
        See the module's docstring.

    Raises
    ------
    ValueError
        When the chain cannot be built or does not suit the scenes, or a picture cannot be
        written.
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
