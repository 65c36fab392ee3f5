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

"""The trials of the paper's protocol, their figures, and the figures that are wanted.

Each trial is a scene of the package, simulated once and run through several chains: the given one,
the same with other windows (as in the paper's Fig. 4) and the same with wider bands and no
stop-band above them (as in its Fig. 7). Trial k of each plate has the seed k, so that the plates
differ only in their spatial period.

The paper gives the means and standard deviations of each plate (Table 2), but not the delays of
single trials, and Figs. 4 and 7 without their values. What the paper does not give is left out.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from benchmarks.measurement import Bound
from slip_detector.chain.samples import Floats, Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation import figures
from slip_detector.parameters import ChainConfig
from slip_detector.scenes import find_scene, load_scene

#: The scenes of the plates, by the spatial period in micrometres (Section 3).
SCENES = {'400': 'plate_400um', '440': 'plate_440um', '480': 'plate_480um'}

#: Table 2: mean and standard deviation of the delay over the trials of each plate.
PAPER_DELAY_MS = {'400': (36.02, 3.91), '440': (41.78, 10.78), '480': (48.90, 9.91)}

#: The share of the time without slip in which the paper's detector was ON.
PAPER_FALSE_POSITIVE_PERCENT = 1.01

#: Fig. 4: lengths of both windows; the last is the paper's choice.
WINDOWS_S = (0.02, 0.03, 0.04)

#: Fig. 7: the band-passes without the high stop-band.
BANDS_HZ = ((10.0, 100.0), (10.0, 150.0))


def simulate_trials(scene: str, seeds: Iterable[int]) -> list[Samples]:
    """Play a scene, given by name or path, once for each seed.

    The truth of the rows is that of the plate's positions (Eq. 9): it lasts from the last row at
    which the plate still stood to the first at which it stands again.

    Raises
    ------
    ValueError
        When there is no such scene or it cannot be read; names it.

    Examples
    --------
    >>> first, second = simulate_trials('plate_440um', [0, 1])
    >>> bool((first.volts == second.volts).all())
    False
    """
    trials = []
    for seed in seeds:
        played = load_scene(find_scene(scene), np.random.default_rng(seed))
        rows: Any = played.read(played.length)
        # There is motion between two rows with different positions, including both of them.
        moves = np.diff(rows.position_m) != 0.0
        truth = np.append(moves, False) | np.append(False, moves)
        trials.append(rows._replace(truth=truth))
    return trials


class Trial(NamedTuple):
    """A trial: the delay of each enabled channel, whether slip was ON, and rows of rest and ON."""

    delays_ms: list[float | None]
    detected: bool
    rest_rows: int
    on_rows: int


def run_trial(chain: SlipChain, trial: Samples) -> Trial:
    """Run a trial, which has one slip, through a chain."""
    chain.reset()
    result, truth = chain.update(trial.volts, envelope=False, level=False), np.asarray(trial.truth)
    disabled = [channel - 1 for channel in chain.config.disabled_channels]
    ons = np.delete(result.channels[truth], disabled, axis=1).T
    rate_hz = chain.config.sample_rate_hz
    delays_ms = [1e3 * float(on.argmax()) / rate_hz if on.any() else None for on in ons]
    on_rows, rest_rows = int(result.slip[~truth].sum()), int((~truth).sum())
    return Trial(delays_ms, bool(result.slip[truth].any()), rest_rows, on_rows)


def plate_figures(trials: Sequence[Trial]) -> dict[str, Any]:
    """Return the paper's figures of merit; see the docstring of :mod:`benchmarks.paper.command`.

    Examples
    --------
    >>> plate_figures([])['trials']
    0
    """
    means_ms = [figures.mean_and_sd(trial.delays_ms)[0] for trial in trials]
    mean_ms, sd_ms = figures.mean_and_sd(means_ms)
    detected = sum(trial.detected for trial in trials)
    on_rows = sum(trial.on_rows for trial in trials)
    return {
        'mean_delay_ms': mean_ms,
        'sd_delay_ms': sd_ms,
        'success_percent': figures.percent(detected, len(trials)),
        'false_positive_percent': figures.percent(on_rows, sum(t.rest_rows for t in trials)),
        'trial_delays_ms': means_ms,
        'detected': detected,
        'trials': len(trials),
        'channels_without_on': sum(trial.delays_ms.count(None) for trial in trials),
    }


def evaluate_plates(
    plates: Mapping[str, Sequence[Samples]], config: ChainConfig
) -> dict[str, dict[str, Any]]:
    """Run trials through one chain.

    Parameters
    ----------
    plates
        The trials of each plate, at least one; see :func:`simulate_trials`.
    config
        The parameters of the chain.

    Returns
    -------
    dict
        ``plates`` and ``all``; see the docstring of :mod:`benchmarks.paper.command`.

    Examples
    --------
    >>> time_s = np.arange(760) / 380.0
    >>> tone = np.where(time_s > 1.0, np.sin(2 * np.pi * 20.0 * time_s), 0.0)
    >>> trial = Samples.evenly(np.tile(tone, (16, 1)).T, 380.0, (time_s > 1.0) & (time_s < 1.5))
    >>> figures = evaluate_plates({'400': [trial]}, ChainConfig())
    >>> figures['plates']['400']['success_percent'], figures['all']['detected']
    (100.0, 1)
    """
    chain = SlipChain(config)
    outcomes = {
        plate: [run_trial(chain, trial) for trial in trials] for plate, trials in plates.items()
    }
    return {
        'plates': {plate: plate_figures(several) for plate, several in outcomes.items()},
        'all': plate_figures([one for several in outcomes.values() for one in several]),
    }


def with_band(config: ChainConfig, passband_hz: tuple[float, float]) -> ChainConfig:
    """Return the configuration with another pass-band, without stop-bands above the first one.

    Examples
    --------
    >>> with_band(ChainConfig(), (10.0, 100.0)).stopbands_hz
    ((0.5, 7.0),)
    """
    top_hz = config.passband_hz[1] or np.inf  # 0: a high-pass, above which there is nothing.
    kept = tuple(pair for pair in config.stopbands_hz if pair[0] < top_hz)
    return replace(config, passband_hz=passband_hz, stopbands_hz=kept)


#: What is wanted: of all trials, that the plate is detected; of each plate a mean delay within the
#: standard deviation of the paper's; that it rises from plate to plate; not more false positives
#: than the paper on any plate; more of them with shorter windows than with the longest; and that
#: each other band shortens the delay on each plate.
_ABOVE_0 = Bound(low=0.0, strict=True)
WANTED = {
    'claims.detected_percent': Bound(low=100.0),
    **{
        f'claims.mean_delay_ms_{plate}': Bound(mean - sd, mean + sd)
        for plate, (mean, sd) in PAPER_DELAY_MS.items()
    },
    'claims.least_rise_ms': _ABOVE_0,
    'claims.worst_false_positive_percent': Bound(high=PAPER_FALSE_POSITIVE_PERCENT),
    'claims.windows_20_more_false_positive_percent': _ABOVE_0,
    'claims.windows_30_more_false_positive_percent': _ABOVE_0,
    'claims.bands_10-100_least_shortening_ms': _ABOVE_0,
    'claims.bands_10-150_least_shortening_ms': _ABOVE_0,
}


def claims(result: Mapping[str, Any]) -> dict[str, float | None]:
    """Return each figure of :data:`WANTED`, None where it is not defined.

    Parameters
    ----------
    result
        ``plates``, ``all``, ``windows`` and ``bands`` as :func:`run_protocol` returns them.
    """

    def means_of(part: Mapping[str, Any]) -> Floats:
        means = [part['plates'][plate]['mean_delay_ms'] for plate in SCENES]
        return np.array(means, np.float64)  # None becomes NaN

    def false_percent(part: Mapping[str, Any]) -> float:
        return float(np.float64(part['false_positive_percent']))

    means, plates = means_of(result), result['plates']
    found = {
        'detected_percent': np.float64(result['all']['success_percent']),
        **dict(zip((f'mean_delay_ms_{plate}' for plate in plates), means, strict=True)),
        'least_rise_ms': np.diff(means).min(),
        'worst_false_positive_percent': np.max([false_percent(plates[one]) for one in SCENES]),
    }
    *shorter, (_, longest) = result['windows'].items()
    for name, part in shorter:
        more = false_percent(part['all']) - false_percent(longest['all'])
        found[f'windows_{name}_more_false_positive_percent'] = more
    for name, part in result['bands'].items():
        found[f'bands_{name}_least_shortening_ms'] = (means - means_of(part)).min()
    return {name: None if np.isnan(figure) else float(figure) for name, figure in found.items()}


def run_protocol(
    plates: Mapping[str, Sequence[Samples]], config: ChainConfig
) -> dict[str, dict[str, Any]]:
    """Run the trials through a chain and its variants.

    Parameters
    ----------
    plates
        The trials of each plate; see :func:`simulate_trials`.
    config
        The parameters of the chain.

    Returns
    -------
    dict
        ``plates``, ``all``, ``windows``, ``bands`` and ``claims``; see the docstring of
        :mod:`benchmarks.paper.command`.
    """
    result = {
        **evaluate_plates(plates, config),
        'windows': {
            f'{window_s * 1e3:.0f}': evaluate_plates(
                plates, replace(config, envelope_window_s=window_s, decision_window_s=window_s)
            )
            for window_s in WINDOWS_S
        },
        'bands': {
            f'{low:g}-{high:g}': evaluate_plates(plates, with_band(config, (low, high)))
            for low, high in BANDS_HZ
        },
    }
    return {**result, 'claims': claims(result)}
