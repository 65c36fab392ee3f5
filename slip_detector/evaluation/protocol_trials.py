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

"""The trials of the paper's protocol: their simulation, replay through a chain, and figures."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.evaluation.labelled_rows import LabelledRows
from slip_detector.evaluation.outcome import ReplayOutcome
from slip_detector.evaluation.paper_figures import paper_figures, trial_delays_ms
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.recordings import RATE_TOLERANCE, rates_differ
from slip_detector.scenes import Scene, find_scene, load_scene

Bools = NDArray[np.bool_]

Floats = NDArray[np.float64]

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

ROWS_PER_READ = 4096


class PlateTrial(NamedTuple):
    """All samples of one trial.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    position_m : ndarray, shape (n,)
        Position of the platform.
    sample_rate_hz : float
    start, end : int
        The last row at which the plate still stood (Eq. 9), and the first row at which it stood
        again.

    Examples
    --------
    >>> trial = PlateTrial(np.full((380, 16), 4.3), np.zeros(380), 380.0, start=95, end=190)
    >>> trial.motion_s, int(trial.moving.sum())
    ((0.25, 0.5), 96)
    """

    volts: Floats
    position_m: Floats
    sample_rate_hz: float
    start: int
    end: int

    @property
    def time_s(self) -> Floats:
        """When each row was taken, from 0; shape (n,)."""
        return np.arange(len(self.volts)) / self.sample_rate_hz

    @property
    def moving(self) -> Bools:
        """Whether the plate moves, from ``start`` to ``end``; shape (n,)."""
        rows = np.arange(len(self.volts))
        return np.asarray((rows >= self.start) & (rows <= self.end))

    @property
    def motion_s(self) -> tuple[float, float]:
        """Times of ``start`` and ``end``."""
        return self.start / self.sample_rate_hz, self.end / self.sample_rate_hz


def plate_trial(volts: Floats, position_m: Floats, sample_rate_hz: float) -> PlateTrial:
    """Make a trial from its samples.

    Parameters
    ----------
    volts : ndarray, shape (n, c)
        Samples of the channels.
    position_m : ndarray, shape (n,)
        Positions of the platform.
    sample_rate_hz
        Rate of both.

    Raises
    ------
    ValueError
        When the position of the platform never changes.

    Examples
    --------
    >>> trial = plate_trial(np.zeros((5, 16)), np.array([0, 0, 1e-3, 2e-3, 2e-3]), 380.0)
    >>> trial.start, trial.end
    (1, 3)
    """
    moved = np.flatnonzero(np.diff(position_m))
    if not moved.size:
        raise ValueError('the platform does not move, allowed: a trial in which it does')
    start, end = int(moved[0]), int(moved[-1]) + 1
    return PlateTrial(volts, position_m, sample_rate_hz, start, end)


def read_trial(scene: Scene) -> PlateTrial:
    """Play a scene to its end.

    Raises
    ------
    ValueError
        As :func:`plate_trial`.

    Examples
    --------
    >>> trial = read_trial(load_scene(find_scene('plate_440um'), np.random.default_rng(0)))
    >>> trial.volts.shape[1], 0 < trial.start < trial.end < len(trial.volts)
    (16, True)
    """
    parts = [scene.read(ROWS_PER_READ)]
    while len(parts[-1].volts) == ROWS_PER_READ:
        parts.append(scene.read(ROWS_PER_READ))
    volts = np.concatenate([part.volts for part in parts])
    position_m = np.concatenate([part.position_m for part in parts])
    return plate_trial(volts, position_m, scene.sample_rate_hz)


def simulate_trials(scene: str, seeds: Iterable[int]) -> list[PlateTrial]:
    """Play a scene once for each seed.

    Parameters
    ----------
    scene
        Name or path of the scene.
    seeds
        Seeds of the noise, one for each trial.

    Raises
    ------
    ValueError
        When there is no such scene, it cannot be read, or its plate does not move; names it.

    Examples
    --------
    >>> first, second = simulate_trials('plate_440um', [0, 1])
    >>> bool((first.volts == second.volts).all())
    False
    """
    path = find_scene(scene)
    scenes = [load_scene(path, np.random.default_rng(seed)) for seed in seeds]
    try:
        return [read_trial(each) for each in scenes]
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from None


def replay_trial(trial: PlateTrial, replay: Replay) -> ReplayOutcome:
    """Run a trial through a chain from its first row; its only slip is the motion of the plate.

    A channel that is first ON after the plate has come to rest has no delay.

    Raises
    ------
    ValueError
        When the trial does not suit the chain.

    Examples
    --------
    >>> volts, position_m = np.full((380, 16), 4.3), np.arange(380) * 1e-5
    >>> outcome = replay_trial(plate_trial(volts, position_m, 380.0), Replay(ChainConfig()))
    >>> len(outcome.slips), outcome.on_rows
    (1, 0)
    """
    config = replay.chain.config
    rate, wanted = trial.sample_rate_hz, config.sample_rate_hz
    if rates_differ(rate, wanted):
        raise ValueError(
            f'the trial has {rate:g} Hz where the parameter sample_rate_hz is {wanted:g} Hz, '
            f'allowed: at most {RATE_TOLERANCE:.0%} apart'
        )
    if trial.volts.shape[1] != config.channels:
        raise ValueError(
            f'the trial has {trial.volts.shape[1]} channels, allowed: {config.channels}, the '
            'parameter channels'
        )
    return replay.run([LabelledRows(trial.volts, trial.moving)], rate)


def plate_figures(outcomes: Sequence[ReplayOutcome]) -> dict[str, Any]:
    """Return the paper's figures of merit of some trials.

    Parameters
    ----------
    outcomes
        At least one, each with one slip.

    Returns
    -------
    dict
        The figures of a plate; see the docstring of :mod:`slip_detector.evaluation.protocol`.

    Examples
    --------
    >>> replay = Replay(ChainConfig(), scores=False, stages=False)
    >>> trials = simulate_trials('plate_440um', [0])
    >>> figures = plate_figures([replay_trial(trial, replay) for trial in trials])
    >>> figures['detected'], figures['trials']
    (1, 1)
    """
    slips = [slip for one in outcomes for slip in one.slips]
    return {
        **paper_figures(
            slips,
            sum(one.on_rows for one in outcomes),
            sum(one.rows - one.slip_rows for one in outcomes),
        ),
        'trial_delays_ms': trial_delays_ms(slips),
        'detected': sum(slip.on_while for slip in slips),
        'trials': len(slips),
        'channels_without_on': sum(slip.channel_delays_s.count(None) for slip in slips),
    }


def evaluate_plates(
    plates: Mapping[str, Sequence[PlateTrial]], config: ChainConfig
) -> dict[str, dict[str, Any]]:
    """Run trials through one chain.

    Parameters
    ----------
    plates
        The trials of each plate, at least one; see :func:`simulate_trials`, and
        :func:`read_trial` for scenes that do not come with the package.
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
    >>> position_m = np.clip(time_s - 1.0, 0.0, 0.5)
    >>> tone = np.where(time_s > 1.0, np.sin(2 * np.pi * 20.0 * time_s), 0.0)
    >>> trial = plate_trial(np.tile(tone, (16, 1)).T, position_m, 380.0)
    >>> figures = evaluate_plates({'400': [trial]}, ChainConfig())
    >>> figures['plates']['400']['success_percent'], figures['all']['detected']
    (100.0, 1)
    """
    replay = Replay(config, scores=False, stages=False)
    outcomes: dict[str, list[ReplayOutcome]] = {}
    for plate, trials in plates.items():
        try:
            outcomes[plate] = [replay_trial(trial, replay) for trial in trials]
        except ValueError as error:
            raise ValueError(f'plate {plate}: {error}') from None
    return {
        'plates': {plate: plate_figures(several) for plate, several in outcomes.items()},
        'all': plate_figures([one for several in outcomes.values() for one in several]),
    }


def with_windows(config: ChainConfig, window_s: float) -> ChainConfig:
    """Return the configuration with another length of both windows.

    Examples
    --------
    >>> with_windows(ChainConfig(), 0.02).decision_window_s
    0.02
    """
    return dataclasses.replace(config, envelope_window_s=window_s, decision_window_s=window_s)


def with_band(config: ChainConfig, passband_hz: tuple[float, float]) -> ChainConfig:
    """Return the configuration with another pass-band, without stop-bands above the first one.

    Examples
    --------
    >>> with_band(ChainConfig(), (10.0, 100.0)).stopbands_hz
    ((0.5, 7.0),)
    """
    top_hz = config.passband_hz[1] or np.inf  # 0: a high-pass, above which there is nothing.
    kept = tuple(pair for pair in config.stopbands_hz if pair[0] < top_hz)
    return dataclasses.replace(config, passband_hz=passband_hz, stopbands_hz=kept)


def band_name(name: str) -> str:
    """Return the name of a band in tables and pictures.

    Examples
    --------
    >>> band_name('10-100')
    '[10, 100] Hz, no high stop-band'
    """
    return f'[{name.replace("-", ", ")}] Hz, no high stop-band'
