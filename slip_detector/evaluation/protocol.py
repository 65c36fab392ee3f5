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
    whether it is ``met``; see :func:`claims`.
``plots``
    The pictures that were written.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Bools, Floats, Samples
from slip_detector.evaluation import figures
from slip_detector.evaluation.figures import Bound, ReplayOutcome
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.fields import refuse
from slip_detector.recordings import rates_differ
from slip_detector.recordings.rates import rate_of
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


def plate_figures(outcomes: Sequence[ReplayOutcome]) -> dict[str, Any]:
    """Return the paper's figures of merit of some trials.

    Parameters
    ----------
    outcomes
        Each has one slip.

    Returns
    -------
    dict
        The figures of a plate; see the docstring of :mod:`slip_detector.evaluation.protocol`.

    Examples
    --------
    >>> plate_figures([])['trials']
    0
    """
    slips = [slip for one in outcomes for slip in one.slips]
    return {
        **figures.paper_figures(outcomes),
        'trial_delays_ms': figures.trial_delays_ms(slips),
        'detected': sum(slip.on_while for slip in slips),
        'trials': len(slips),
        'channels_without_on': sum(slip.channel_delays_s.count(None) for slip in slips),
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
        ``plates`` and ``all``; see the docstring of :mod:`slip_detector.evaluation.protocol`.

    Raises
    ------
    ValueError
        When the chain cannot be built or a trial does not suit it; names the plate.

    Examples
    --------
    >>> time_s = np.arange(760) / 380.0
    >>> tone = np.where(time_s > 1.0, np.sin(2 * np.pi * 20.0 * time_s), 0.0)
    >>> trial = Samples.evenly(np.tile(tone, (16, 1)).T, 380.0, (time_s > 1.0) & (time_s < 1.5))
    >>> figures = evaluate_plates({'400': [trial]}, ChainConfig())
    >>> figures['plates']['400']['success_percent'], figures['all']['detected']
    (100.0, 1)
    """
    replay = Replay(config)
    outcomes = {}
    for plate, trials in plates.items():
        rate = rate_of(trials[0].stamps_ns, f'the stamps of plate {plate}')
        channels = trials[0].volts.shape[1]
        if rates_differ(rate, config.sample_rate_hz) or channels != config.channels:
            text = f'{config.channels} at {config.sample_rate_hz:g} Hz'
            text = f'as the parameters channels and sample_rate_hz, {text}'
            refuse(f'plate {plate} has {channels} channels at {rate:g} Hz', text)
        outcomes[plate] = [replay.run([trial]) for trial in trials]
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


#: Trials on each plate (Section 3).
TRIALS = 10


def claims(result: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return of each wanted figure its value, None where undefined, its bound, and if it is met.

    Wanted are, of all trials, that the plate is detected; of each plate a mean delay within the
    standard deviation of the paper's; that it rises from plate to plate; not more false positives
    than the paper on any plate; more of them with shorter windows than with the longest; and that
    each other band shortens the delay on each plate.

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

    above_0, means, plates = Bound(low=0.0, strict=True), means_of(result), result['plates']
    worst = np.max([false_percent(plates[plate]) for plate in SCENES])
    detected = np.float64(result['all']['success_percent'])
    found = {'detected_percent': (detected, Bound(low=100.0))}
    for mean, (plate, (paper, sd)) in zip(means, PAPER_DELAY_MS.items(), strict=True):
        found[f'mean_delay_ms.{plate}'] = mean, Bound(paper - sd, paper + sd)
    found['least_rise_ms'] = np.diff(means).min(), above_0
    found['worst_false_positive_percent'] = worst, Bound(high=PAPER_FALSE_POSITIVE_PERCENT)
    *shorter, (_, longest) = result['windows'].items()
    for name, part in shorter:
        more = false_percent(part['all']) - false_percent(longest['all'])
        found[f'windows.{name}.false_positive_percent_more'] = more, above_0
    for name, part in result['bands'].items():
        found[f'bands.{name}.least_shortening_ms'] = (means - means_of(part)).min(), above_0
    return {
        name: bound.verdict(None if np.isnan(figure) else float(figure))
        for name, (figure, bound) in found.items()
    }


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

    Examples
    --------
    >>> result = run_protocol(ChainConfig(), trials=1)
    >>> result['all']['detected'], list(result['windows'])
    (3, ['20', '30', '40'])
    """
    seeds = list(range(seed, seed + trials))
    plates = {plate: simulate_trials(scene, seeds) for plate, scene in SCENES.items()}
    result: dict[str, Any] = {
        'seeds': seeds,
        'scenes': dict(SCENES),
        'paper': {
            'plates': {
                plate: {'mean_delay_ms': mean, 'sd_delay_ms': sd}
                for plate, (mean, sd) in PAPER_DELAY_MS.items()
            },
            'false_positive_percent': PAPER_FALSE_POSITIVE_PERCENT,
        },
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
    result['wanted'] = claims(result)
    written = [] if draw is None else draw(plates, config, result)
    return {**result, 'plots': [str(path) for path in written]}


class Heard(NamedTuple):
    """What a program has heard of a trial.

    Times (since the first sample) and volts of the samples, times and positions of the plate, the
    time from the stamp of each sample to the receipt of its decision, and for each topic of a
    decision the times at which its state changed, and the new states.
    """

    stamps_s: Floats
    volts: Floats
    position_stamps_s: Floats
    positions_m: Floats
    latencies_s: Floats
    changes: Mapping[str, tuple[Floats, Bools]]

    @property
    def motion_s(self) -> tuple[float, float] | None:
        """When the plate started and stopped (Eq. 9); None if it did not move."""
        moved = np.flatnonzero(np.diff(self.positions_m))
        if not moved.size:
            return None
        return self.position_stamps_s[moved[0]], self.position_stamps_s[moved[-1] + 1]


def states_at(changed_at: NDArray[Any], states: Bools, at: NDArray[Any]) -> Bools:
    """Return the state at each time: that of the last change at or before it.

    Parameters
    ----------
    changed_at : ndarray of int or float, shape (k,)
        Times at which the state was published, in rising order.
    states : ndarray of bool, shape (k,)
        The states.
    at : ndarray of int or float, shape (n,)
        The times for which the state is wanted, in the same unit.

    Returns
    -------
    ndarray of bool, shape (n,)
        False before the first change.

    Examples
    --------
    >>> states_at(np.array([10, 20]), np.array([True, False]), np.array([5, 10, 19, 20]))
    array([False,  True,  True, False])
    """
    from_none_on = np.concatenate([[False], states])
    return np.asarray(from_none_on[np.searchsorted(changed_at, at, side='right')])


def demo_figures(heard: Heard, config: ChainConfig) -> dict[str, Any]:
    """Compute the paper's figures of merit from the received messages.

    A delay begins at the stamp of the last sample at which the plate still stood (Eq. 9) and ends
    at the receipt of the first ON after it, as a grasp controller would see it. It is None if
    there is no such ON, or nothing moves.
    """
    times_s, moves = heard.stamps_s, heard.motion_s
    start_s, end_s = moves or (np.inf, np.inf)

    def delay_ms(topic: str) -> float | None:
        at_s, states = heard.changes[topic]
        on_s = at_s[states & (at_s >= start_s)]
        return (float(on_s[0]) - start_s) * 1e3 if on_s.size else None

    slip = states_at(*heard.changes['slip'], times_s)
    rest = (times_s < start_s) | (times_s > end_s)
    channels = {name: delay_ms(f'slip/channel/{name}') for name in config.names}
    mean, sd = figures.mean_and_sd(channels.values())
    median, p99 = np.percentile(heard.latencies_s, [50, 99]) * 1e3
    return {
        'motion': {'start_s': start_s, 'end_s': end_s} if moves else None,
        'channel_delay_ms': channels,
        'mean_delay_ms': mean,
        'sd_delay_ms': sd,
        'group_delay_ms': {name: delay_ms(f'slip/group/{name}') for name in config.groups},
        'global_delay_ms': delay_ms('slip'),
        'false_positive_percent': figures.percent(int((slip & rest).sum()), int(rest.sum())),
        'latency_ms': {'median': median, 'p99': p99},
    }
