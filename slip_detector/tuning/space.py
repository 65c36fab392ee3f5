"""What is searched: chains around the given one, and the votes and thresholds of each.

Votes and thresholds are no part of a point of the space: all of them come from one pass of the
chain (:mod:`slip_detector.tuning.sweep`), so a trial is one point with the best of them.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.evaluation.labelled_rows import SLIP
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.tracks import Track

Floats = NDArray[np.float64]
Vote = str | int

#: Edges as shares of the sample rate: the lowest and highest low edge of the pass-band, and the
#: highest edge of all. A pass-band that would end above it is a high-pass.
LOWEST_LOW, HIGHEST_LOW, HIGHEST = 1 / 400, 0.3, 0.48

#: The width of the pass-band; the paper's has 2.8 octaves.
OCTAVES = (0.5, 6.0)

#: The stop-bands at the sides of the pass-band, as wide as the paper's: 0.5 to 7 and 50 to 180 Hz.
BELOW, ABOVE = 7.0 / 0.5, 180.0 / 50.0

#: A stop-band around the mains takes this off at each side.
NOTCH_HALF_WIDTH_HZ = 5.0
MAINS_HZ = (50.0, 60.0)

SHORTEST_WINDOW_S, LONGEST_WINDOW_S = 0.005, 0.3

STOPBANDS = ('given', 'none', 'below', 'above', 'both')

COMMON_MODES = ('none', 'median', 'mean')

#: Fewer channels than this have nothing in common that is not the signal.
LEAST_SHARING = 3

#: Groups up to this size are tried with every k-of-n, larger ones with shares of their size.
ALL_COUNTS = 6
SHARES = (1 / 8, 1 / 4, 3 / 8, 1 / 2, 5 / 8, 3 / 4, 7 / 8)

#: Thresholds are so far apart in amplitude (the level to the power of 1 / exponent).
STEP = 1.03

#: No threshold is further than this, in amplitude, below the highest that does anything.
RANGE = 1000.0

#: Of every so many rows one tells where the thresholds begin.
STRIDE = 16


class SearchSpace:
    """The chains that are tried: the given one with other bands, windows and stages.

    Parameters
    ----------
    given
        The chain that is tuned; what is not searched stays as it is.
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
        self._common_modes = COMMON_MODES if enabled >= LEAST_SHARING else ('none',)

    def distributions(self) -> dict[str, Any]:
        """Return Optuna's distributions by name."""
        from optuna.distributions import (
            CategoricalDistribution,
            FloatDistribution,
            IntDistribution,
        )

        return {
            'passband_low_hz': FloatDistribution(*self._low_hz, log=True),
            'passband_octaves': FloatDistribution(*OCTAVES),
            'stopbands': CategoricalDistribution(STOPBANDS),
            'notch_hz': CategoricalDistribution(self.notches_hz),
            'exponent': IntDistribution(*self._exponents),
            'envelope_window_s': FloatDistribution(*self._window_s, log=True),
            'decision_window_s': FloatDistribution(*self._window_s, log=True),
            'common_mode': CategoricalDistribution(self._common_modes),
        }

    def chain(self, point: dict[str, Any]) -> ChainConfig:
        """Return the chain of a point, with the given threshold and vote.

        Raises
        ------
        ValueError
            When there is no such chain.
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
            # Rounding must not leave less than a sample.
            envelope_window_s=max(rounded(point['envelope_window_s']), self._window_s[0]),
            decision_window_s=max(rounded(point['decision_window_s']), self._window_s[0]),
            common_mode=point['common_mode'],
        )

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
        """Return the point of the space that is nearest to a chain: where a search may start."""
        low_hz, high_hz = chain.passband_hz
        octaves = math.log2(high_hz / low_hz) if high_hz else OCTAVES[1]
        return {
            'passband_low_hz': _within(low_hz, self._low_hz),
            'passband_octaves': _within(octaves, OCTAVES),
            'stopbands': 'given' if chain.stopbands_hz == self._given.stopbands_hz else 'both',
            'notch_hz': 0.0,
            'exponent': int(_within(chain.exponent, self._exponents)),
            'envelope_window_s': _within(chain.envelope_window_s, self._window_s),
            'decision_window_s': _within(chain.decision_window_s, self._window_s),
            'common_mode': chain.common_mode
            if chain.common_mode in self._common_modes
            else 'none',
        }

    def distance(self, point: dict[str, Any], other: dict[str, Any]) -> float:
        """Return how far two points are apart: 1 is one way through, or another choice."""
        low, high = self._window_s
        spans = {
            'passband_low_hz': math.log(self._low_hz[1] / self._low_hz[0]),
            'envelope_window_s': math.log(high / low),
            'decision_window_s': math.log(high / low),
        }
        steps = [math.log(point[name] / other[name]) / span for name, span in spans.items()]
        steps.append((point['passband_octaves'] - other['passband_octaves']) / OCTAVES[1])
        steps.append((point['exponent'] - other['exponent']) / self._exponents[1])
        steps += [
            float(point[name] != other[name]) for name in ('stopbands', 'notch_hz', 'common_mode')
        ]
        return math.hypot(*steps)

    def starts(self) -> list[dict[str, Any]]:
        """Return where a search begins: at the given chain and at the paper's."""
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


def thresholds(statistic: Sequence[Floats], tracks: Sequence[Track], exponent: int) -> Floats:
    """Return the thresholds of a vote that are worth a look, rising, evenly spaced in amplitude.

    They reach from the level that half of the rows without slip have to where nothing is ON, and
    are rounded: the threshold of a result is one that was tried.

    Parameters
    ----------
    statistic
        By track, shapes (n,).
    tracks
        At least one.
    exponent
        The chain's.

    Returns
    -------
    ndarray
        Empty where the statistic is 0 throughout, or infinite anywhere.
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
    return np.array([*below, _rounded_up(top)])


def _within(value: float, bounds: tuple[float, float]) -> float:
    return min(max(value, bounds[0]), bounds[1])


def rounded(value: float) -> float:
    """Round to four significant digits: more would only make the file hard to read.

    Examples
    --------
    >>> rounded(0.0123456)
    0.01235
    """
    return float(f'{value:.4g}')


def _rounded_up(value: float) -> float:
    """Round to four significant digits, to what is not less."""
    near = rounded(value)
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return near if near >= value else rounded(near + step)
