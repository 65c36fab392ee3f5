"""The search space: chains around the given one, and the votes and thresholds of each.

A point of the space has no vote and no threshold: one pass of the chain gives the figures of all
of them (:mod:`slip_detector.tuning.sweep`), and a trial takes the best.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.evaluation.labelled_rows import SLIP
from slip_detector.parameters.detector import COMMON_MODES, ChainConfig
from slip_detector.tuning.tracks import Track

Floats = NDArray[np.float64]
Vote = str | int

#: Edges as shares of the sample rate: lowest and highest low edge of the pass-band, and the
#: highest edge of any band. A pass-band that would end above that is a high-pass.
LOWEST_LOW, HIGHEST_LOW, HIGHEST = 1 / 400, 0.3, 0.48

#: Narrowest and widest pass-band in octaves; the paper's has 2.8 octaves.
OCTAVES = (0.5, 6.0)

#: High edge over low edge of the stop-bands below and above the pass-band, as in the paper: 0.5 to
#: 7 Hz and 50 to 180 Hz.
BELOW, ABOVE = 7.0 / 0.5, 180.0 / 50.0

#: Half the width of a stop-band around the mains frequency.
NOTCH_HALF_WIDTH_HZ = 5.0
MAINS_HZ = (50.0, 60.0)

SHORTEST_WINDOW_S, LONGEST_WINDOW_S = 0.005, 0.3

STOPBANDS = ('given', 'none', 'below', 'above', 'both')

#: With fewer channels than this the common mode would be mostly signal.
LEAST_SHARING = 3

#: Groups up to this size are tried with every k of n, larger ones with these shares of n.
ALL_COUNTS = 6
SHARES = (1 / 8, 1 / 4, 3 / 8, 1 / 2, 5 / 8, 3 / 4, 7 / 8)

#: Ratio of neighbouring thresholds in amplitude (the level to the power of 1 / exponent).
STEP = 1.03

#: Largest ratio, in amplitude, of the highest threshold to the lowest.
RANGE = 1000.0

#: Ranges of what evidence is made with: how often the given noise floors, in amplitude, and the
#: offset, the cap above it and the limit.
FLOOR_SCALE = (0.1, 10.0)
OFFSET_DB, CAP_ABOVE_DB, LIMIT_DB_S = (0.5, 12.0), (1.0, 30.0), (0.02, 5.0)

#: One of this many rows is used to find the lowest threshold.
STRIDE = 16


class SearchSpace:
    """The chains that are tried: the given one with other bands, windows and stages.

    The decision is that of the given chain: where it is by evidence, what evidence is made with is
    searched in place of the second window.

    Parameters
    ----------
    given
        The chain that is tuned; parameters that are not searched keep their values.

    Examples
    --------
    >>> space = SearchSpace(ChainConfig())
    >>> point = space.point(ChainConfig())
    >>> point['passband_low_hz'], point['stopbands']
    (7.0, 'given')
    >>> space.chain({**point, 'passband_octaves': 3.0, 'stopbands': 'none'}).passband_hz
    (7.0, 56.0)
    """

    def __init__(self, given: ChainConfig) -> None:
        self._given = given
        rate = given.sample_rate_hz
        self._highest_hz = HIGHEST * rate
        self._low_hz = (LOWEST_LOW * rate, HIGHEST_LOW * rate)
        self._window_s = (max(SHORTEST_WINDOW_S, 1.0 / rate), LONGEST_WINDOW_S)
        self._exponents = (1, max(4, given.exponent))
        self.notches_hz = (0.0, *(f for f in MAINS_HZ if f + NOTCH_HALF_WIDTH_HZ < HIGHEST * rate))
        enabled = given.channels - len(given.disabled_channels)
        self._evidence = given.decision == 'evidence'
        self.mains_hz = (0.0, *filter(self._has_whole_periods, MAINS_HZ))
        self._common_modes = COMMON_MODES if enabled >= LEAST_SHARING else ('none',)

    def distributions(self) -> dict[str, Any]:
        """Return Optuna's distributions by name."""
        from optuna.distributions import (
            CategoricalDistribution,
            FloatDistribution,
            IntDistribution,
        )

        of_decision: dict[str, Any] = {
            'decision_window_s': FloatDistribution(*self._window_s, log=True)
        }
        if self._evidence:
            of_decision = {
                'mains_hz': CategoricalDistribution(self.mains_hz),
                'floor_scale': FloatDistribution(*FLOOR_SCALE, log=True),
                'evidence_offset_db': FloatDistribution(*OFFSET_DB),
                'cap_above_db': FloatDistribution(*CAP_ABOVE_DB),
                'evidence_limit_db_s': FloatDistribution(*LIMIT_DB_S, log=True),
            }
        return {
            'passband_low_hz': FloatDistribution(*self._low_hz, log=True),
            'passband_octaves': FloatDistribution(*OCTAVES),
            'stopbands': CategoricalDistribution(STOPBANDS),
            'notch_hz': CategoricalDistribution(self.notches_hz),
            'exponent': IntDistribution(*self._exponents),
            'envelope_window_s': FloatDistribution(*self._window_s, log=True),
            **of_decision,
            'common_mode': CategoricalDistribution(self._common_modes),
        }

    def chain(self, point: dict[str, Any]) -> ChainConfig:
        """Return the chain of a point, with the given threshold and vote.

        A threshold that its evidence cannot reach is half the limit.

        Raises
        ------
        ValueError
            When its parameters do not go together.
        """
        low_hz = rounded(point['passband_low_hz'])
        high_hz = rounded(low_hz * 2.0 ** point['passband_octaves'])
        if high_hz > self._highest_hz:
            high_hz = 0.0
        return dataclasses.replace(
            self._given,
            passband_hz=(low_hz, high_hz),
            stopbands_hz=self._stopbands(point, low_hz, high_hz),
            exponent=point['exponent'],
            # A rounded window must not be shorter than a sample.
            envelope_window_s=max(rounded(point['envelope_window_s']), self._window_s[0]),
            common_mode=point['common_mode'],
            **self._of_decision(point),
        )

    def _of_decision(self, point: dict[str, Any]) -> dict[str, Any]:
        """Return the parameters of the decision at a point."""
        if not self._evidence:
            window_s = max(rounded(point['decision_window_s']), self._window_s[0])
            return {'decision_window_s': window_s}
        given, scale = self._given, rounded(point['floor_scale'])
        power = point['exponent'] / given.exponent
        floors = given.noise_floor
        if scale != 1.0 or power != 1.0:
            factor = scale ** point['exponent']
            floors = tuple(rounded(factor * floor**power) for floor in floors)
        offset_db = rounded(point['evidence_offset_db'])
        limit_db_s = rounded(point['evidence_limit_db_s'])
        reachable = given.threshold < limit_db_s
        return {
            'mains_hz': point['mains_hz'],
            'noise_floor': floors,
            'evidence_offset_db': offset_db,
            'evidence_cap_db': rounded(offset_db + point['cap_above_db']),
            'evidence_limit_db_s': limit_db_s,
            'threshold': given.threshold if reachable else rounded(0.5 * limit_db_s),
        }

    def _has_whole_periods(self, mains_hz: float) -> bool:
        """Return whether the mains has whole periods in rows of the given rate."""
        try:
            return dataclasses.replace(self._given, mains_hz=mains_hz).mains_rows > 0
        except ValueError:
            return False

    def _stopbands(
        self, point: dict[str, Any], low_hz: float, high_hz: float
    ) -> tuple[tuple[float, float], ...]:
        """Return the stop-bands beside the pass-band, and the notch."""
        which, mains_hz = point['stopbands'], point['notch_hz']
        pairs = list(self._given.stopbands_hz) if which == 'given' else []
        if which in ('below', 'both'):
            pairs.append((rounded(low_hz / BELOW), low_hz))
        top_hz = min(rounded(ABOVE * high_hz), rounded(self._highest_hz))
        if which in ('above', 'both') and 0.0 < high_hz < top_hz / 1.1:
            pairs.append((high_hz, top_hz))
        if mains_hz:
            pairs.append((mains_hz - NOTCH_HALF_WIDTH_HZ, mains_hz + NOTCH_HALF_WIDTH_HZ))
        return tuple(pairs)

    def point(self, chain: ChainConfig) -> dict[str, Any]:
        """Return the point of the space that is nearest to a chain."""
        low_hz, high_hz = chain.passband_hz
        octaves = math.log2(high_hz / low_hz) if high_hz else OCTAVES[1]
        of_decision: dict[str, Any] = {
            'decision_window_s': _within(chain.decision_window_s, self._window_s)
        }
        if self._evidence:
            offset_db = chain.evidence_offset_db
            of_decision = {
                'mains_hz': chain.mains_hz if chain.mains_hz in self.mains_hz else 0.0,
                'floor_scale': 1.0,
                'evidence_offset_db': _within(offset_db, OFFSET_DB),
                'cap_above_db': _within(chain.evidence_cap_db - offset_db, CAP_ABOVE_DB),
                'evidence_limit_db_s': _within(chain.evidence_limit_db_s, LIMIT_DB_S),
            }
        return {
            'passband_low_hz': _within(low_hz, self._low_hz),
            'passband_octaves': _within(octaves, OCTAVES),
            'stopbands': 'given' if chain.stopbands_hz == self._given.stopbands_hz else 'both',
            'notch_hz': 0.0,
            'exponent': int(_within(chain.exponent, self._exponents)),
            'envelope_window_s': _within(chain.envelope_window_s, self._window_s),
            **of_decision,
            'common_mode': chain.common_mode
            if chain.common_mode in self._common_modes
            else 'none',
        }

    def distance(self, point: dict[str, Any], other: dict[str, Any]) -> float:
        """Return the distance of two points: 1 for another choice, or for a parameter's range."""
        low, high = self._window_s
        spans = {
            'passband_low_hz': math.log(self._low_hz[1] / self._low_hz[0]),
            'envelope_window_s': math.log(high / low),
            'decision_window_s': math.log(high / low),
        }
        choices = ['stopbands', 'notch_hz', 'common_mode']
        linear = {}
        if self._evidence:
            del spans['decision_window_s']
            spans['floor_scale'] = math.log(FLOOR_SCALE[1] / FLOOR_SCALE[0])
            spans['evidence_limit_db_s'] = math.log(LIMIT_DB_S[1] / LIMIT_DB_S[0])
            linear = {'evidence_offset_db': OFFSET_DB[1], 'cap_above_db': CAP_ABOVE_DB[1]}
            choices.append('mains_hz')
        steps = [math.log(point[name] / other[name]) / span for name, span in spans.items()]
        steps += [(point[name] - other[name]) / span for name, span in linear.items()]
        steps.append((point['passband_octaves'] - other['passband_octaves']) / OCTAVES[1])
        steps.append((point['exponent'] - other['exponent']) / self._exponents[1])
        steps += [float(point[name] != other[name]) for name in choices]
        return math.hypot(*steps)

    def starts(self) -> list[dict[str, Any]]:
        """Return the points where a search begins: the given chain and the paper's."""
        points = [self.point(self._given), self.point(ChainConfig())]
        return points if points[0] != points[1] else points[:1]


def votes_of(config: ChainConfig) -> tuple[Vote, ...]:
    """Return the votes that are tried: ``all``, ``mean`` and k-of-n, the given one among them.

    Examples
    --------
    >>> votes_of(ChainConfig())
    ('all', 'mean', 1, 2, 3)
    """
    disabled = set(config.disabled_channels)
    able = [len(set(members) - disabled) for members in config.groups.values()]
    size = min(many for many in able if many)
    counts = range(1, size) if size <= ALL_COUNTS else [round(share * size) for share in SHARES]
    votes: list[Vote] = ['all', 'mean', *counts]
    return tuple(votes) if config.vote in votes else (*votes, config.vote)


def threshold_scale(chain: ChainConfig) -> tuple[int, float]:
    """Return the exponent of a chain's level in amplitude, and what thresholds are below.

    Evidence is of decibels: no power of an amplitude, but bounded.

    Examples
    --------
    >>> threshold_scale(ChainConfig())
    (3, inf)
    >>> threshold_scale(ChainConfig(decision='evidence', noise_floor=1e-3))
    (1, 1.3)
    """
    if chain.decision == 'evidence':
        return 1, chain.evidence_limit_db_s
    return chain.exponent, math.inf


def thresholds(
    statistic: Sequence[Floats],
    tracks: Sequence[Track],
    exponent: int,
    limit: float = math.inf,
) -> Floats:
    """Return the thresholds of a vote to try, in rising order, evenly spaced in amplitude.

    They reach from the median of the rows without slip to the value at which nothing is ON. They
    are rounded first and then tried, so that the threshold of a result is one that was tried.

    Parameters
    ----------
    statistic
        The decision statistic of each track, shapes (n,).
    tracks
        At least one.
    exponent
        The exponent of the level in amplitude.
    limit
        What thresholds are below; see :func:`threshold_scale`.

    Returns
    -------
    ndarray
        Empty where the statistic is 0 throughout or infinite anywhere.

    Examples
    --------
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.tuning.tracks import track_of
    >>> rows = LabelledRows(np.zeros((20, 1)), truth=np.zeros(20, bool))
    >>> tracks = [track_of('rest', [rows], sample_rate_hz=100.0)]
    >>> thresholds([np.linspace(0.95, 1.0, 20)], tracks, exponent=1)
    array([0.9709, 1.    ])
    """
    top = max((float(part.max()) for part in statistic if part.size), default=0.0)
    if not 0.0 < top < math.inf:
        return np.zeros(0)
    quiet = [
        part[::STRIDE][track.kinds[::STRIDE] != SLIP]
        for part, track in zip(statistic, tracks, strict=True)
    ]
    rest = float(np.median(np.concatenate(quiet))) if any(part.size for part in quiet) else 0.0
    ratio = STEP**exponent
    low = max(rest, top * RANGE**-exponent, 1e-30)
    steps = math.ceil(math.log(top / low) / math.log(ratio)) if low < top else 0
    below = [rounded(top * ratio**step) for step in range(-steps, 0)]
    found = np.array([*below, _rounded_up(top)])
    return found[found < limit]


def _within(value: float, bounds: tuple[float, float]) -> float:
    return min(max(value, bounds[0]), bounds[1])


def rounded(value: float) -> float:
    """Round to four significant digits, which keeps the parameter file readable.

    Examples
    --------
    >>> rounded(0.0123456)
    0.01235
    """
    return float(f'{value:.4g}')


def _rounded_up(value: float) -> float:
    """Round up to four significant digits."""
    near = rounded(value)
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return near if near >= value else rounded(near + step)
