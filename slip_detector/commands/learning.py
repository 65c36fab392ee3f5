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

"""What ``slip_tune`` learns from a recording at rest or of knocks, without a search."""

import dataclasses
from argparse import Namespace
from typing import Any, NamedTuple

import numpy as np

from slip_detector.evaluation.loading import RecordingLoader
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.impacts import impact_step
from slip_detector.tuning.loading import load_tracks
from slip_detector.tuning.noise import (
    LEARNT_RANGE_DB,
    LEAST_S,
    Mains,
    find_mains,
    learnt_floors,
)
from slip_detector.tuning.tracks import Track


class LearntParameters(NamedTuple):
    """The parameters that are learnt from a recording at rest or of knocks.

    Attributes
    ----------
    parameters : dict
        Parameters of the chain by name, as ROS has them.
    lines : list of str
        What the command prints about them.

    Examples
    --------
    >>> LearntParameters({'threshold': 2.2}, ['On rest.npz: threshold 2.2']).parameters
    {'threshold': 2.2}
    """

    parameters: dict[str, Any]
    lines: list[str]


def learn_from_quiet(
    options: Namespace, chain: ChainConfig, loader: RecordingLoader
) -> LearntParameters:
    """Learn noise floors, mains and threshold from a recording without slip.

    Noise floors and mains are set where evidence decides; the threshold is set where a rate of
    false alarms is given.

    Parameters
    ----------
    options
        The options of the command.
    chain
        The given chain.
    loader
        Opens recordings for this chain.

    Raises
    ------
    ValueError
        When the recording cannot be read or is too short, or there is nothing to learn from it;
        names it.
    """
    rate, by_evidence = options.false_alarms_per_hour, chain.decision == 'evidence'
    if rate is None and not by_evidence:
        raise ValueError(
            'parameter decision is mean, allowed: evidence, whose noise floors --quiet learns, '
            'or --false-alarms-per-hour, which sets the threshold'
        )
    track, lines = _only(options.quiet, loader)
    if by_evidence and track.duration_s < LEAST_S:
        raise ValueError(
            f'{track.name}: lasts {track.duration_s:.3g} s, allowed: at least {LEAST_S:g} s at '
            'rest'
        )
    names = []
    mains = find_mains(chain, track)
    lines.append(f'On {track.name}: {mains}')
    if mains.lines and not chain.mains_hz:
        without_hum = _with_mains(chain, mains)
        if without_hum is None:
            lines.append(
                f'mains_hz cannot remove it: it has no whole periods in rows of '
                f'{chain.sample_rate_hz:g} Hz; a stop-band can'
            )
        elif by_evidence:
            chain = without_hum
            names.append('mains_hz')
        else:
            lines.append(f'mains_hz: {mains.mains_hz:g} would remove it')
    if by_evidence:
        floors = learnt_floors(chain, [track])
        chain = dataclasses.replace(
            chain,
            noise_floor=floors,
            noise_floor_learnt=True,
            noise_floor_range_db=LEARNT_RANGE_DB,
        )
        names += ['noise_floor', 'noise_floor_learnt', 'noise_floor_range_db']
        lines.append(f'Noise floors of {min(floors):.4g} to {max(floors):.4g}')
    if rate is not None:
        # SciPy's statistics take longer to load than all else.
        from slip_detector.tuning.quiet import quiet_threshold

        found = quiet_threshold(track, chain, rate, np.random.default_rng(options.seed))
        chain = found.chain
        names.append('threshold')
        lines.append(f'On {track.name}, without slip: {found}')
    learnt = chain.to_parameters()
    return LearntParameters({name: learnt[name] for name in names}, lines)


def learn_from_taps(
    options: Namespace, chain: ChainConfig, loader: RecordingLoader
) -> LearntParameters:
    """Set the step that is an impact from a recording of knocks and labelled slips.

    Parameters are those of :func:`learn_from_quiet`.

    Raises
    ------
    ValueError
        When a recording cannot be read, evidence does not decide, or the steps of knocks and slips
        are too similar.
    """
    if chain.decision != 'evidence':
        raise ValueError(
            f'parameter decision is {chain.decision}, allowed: evidence, which impact_v is for'
        )
    knocks, lines = _only(options.taps, loader)
    tracks, more_lines = load_tracks(options.recordings, loader)
    found = impact_step(chain, knocks, tracks)
    return LearntParameters(
        {'impact_v': found.impact_v}, [*lines, *more_lines, f'{knocks.name}: {found}']
    )


def _only(path: str, loader: RecordingLoader) -> tuple[Track, list[str]]:
    """Read the one recording of a path, and the line of its faults."""
    tracks, notes = load_tracks([path], loader, labelled=False)
    if len(tracks) != 1:
        raise ValueError(f'{path}: has {len(tracks)} recordings, allowed: one')
    return tracks[0], notes


def _with_mains(chain: ChainConfig, mains: Mains) -> ChainConfig | None:
    """Return the chain that removes the mains; None where its sample rate does not allow it."""
    try:
        return dataclasses.replace(chain, mains_hz=mains.mains_hz)
    except ValueError:
        return None
