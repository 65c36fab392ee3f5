"""The surface under a sliding taxel: ridges at a spatial period, or a flat one's roughness."""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.parameters.sets import ParameterSet, parameter

Floats = NDArray[np.float64]

#: Points of the profile of a rough surface for each correlation length of it, and their number:
#: after so many the profile repeats.
POINTS_PER_LENGTH = 8
PROFILE_POINTS = 8192

#: Below this part of a point's distance a mean over the way is the height in its middle.
SHORT = 1e-3


class RidgeNumbers(NamedTuple):
    """What the compiled code needs of a :class:`Texture`."""

    wavenumber_rad_m: float
    start_rad: float
    amplitudes: Floats


class RoughNumbers(NamedTuple):
    """What the compiled code needs of a :class:`Roughness`: a profile and its running integral."""

    per_m: float
    heights: Floats
    integral: Floats


@dataclasses.dataclass(frozen=True)
class Texture(ParameterSet):
    """Ridges across the direction of motion."""

    spatial_period_m: float = parameter(
        400e-6, 'Distance from ridge to ridge.', unit='m', low=1e-6, high=1.0
    )
    ridge_height_m: float = parameter(
        100e-6, 'Height of a ridge above the middle.', unit='m', low=0.0, high=1e-2
    )
    harmonics: tuple[float, ...] = parameter(
        (0.0, -0.22),
        'Heights of the second, third, ... harmonic as shares of the first; [] for a sine.',
        low=-10.0,
        high=10.0,
    )
    indentation_m: float = parameter(
        670e-6, 'Height that doubles the load of the taxel over it.', unit='m', low=1e-9, high=1.0
    )

    def __post_init__(self) -> None:
        """Check that no groove lifts a taxel off."""
        super().__post_init__()
        highest_m = self.ridge_height_m * (1.0 + sum(map(abs, self.harmonics)))
        if highest_m > self.indentation_m:
            raise ValueError(
                f'parameter ridge_height_m is {self.ridge_height_m:g} m, allowed: with its '
                f'harmonics at most indentation_m, {self.indentation_m:g} m'
            )

    @property
    def highest_wavenumber_1_m(self) -> float:
        """Ridges per metre of the highest harmonic."""
        return (1 + len(self.harmonics)) / self.spatial_period_m

    def numbers(self, trial: np.random.Generator) -> RidgeNumbers:
        """Return what the compiled code needs; where the plate is put down, the trial decides."""
        heights = self.ridge_height_m * np.array([1.0, *self.harmonics])
        return RidgeNumbers(
            2.0 * np.pi / self.spatial_period_m,
            2.0 * np.pi * trial.random(),
            heights / self.indentation_m,
        )


@dataclasses.dataclass(frozen=True)
class Roughness(ParameterSet):
    """A flat surface with a random profile, Gaussian with a Gaussian correlation."""

    height_rms_m: float = parameter(
        0.2e-6, 'Standard deviation of the height.', unit='m', low=0.0, high=1e-2
    )
    correlation_m: float = parameter(
        50e-6, 'Correlation length of the profile.', unit='m', low=1e-9, high=1.0
    )
    indentation_m: float = parameter(
        670e-6, 'Height that doubles the load of the taxel over it.', unit='m', low=1e-9, high=1.0
    )
    surface_seed: int = parameter(1, 'Seed of the profile: one seed is one surface.', low=0)

    def numbers(self) -> RoughNumbers:
        """Return what the compiled code needs: the profile in shares of the indentation."""
        noise = np.random.default_rng(self.surface_seed).standard_normal(PROFILE_POINTS)
        # Two passes of a Gaussian filter of this width correlate as exp(-(distance / length)^2).
        cycles = np.fft.rfftfreq(PROFILE_POINTS) * POINTS_PER_LENGTH
        profile = np.fft.irfft(np.fft.rfft(noise) * np.exp(-0.5 * np.square(np.pi * cycles)))
        profile -= profile.mean()
        heights = profile * (self.height_rms_m / self.indentation_m / profile.std())
        # Of the cubic through four neighbours, from one point to the next.
        before, one, two = np.roll(heights, 1), np.roll(heights, -1), np.roll(heights, -2)
        areas = (13.0 * (heights + one) - before - two) / 24.0
        integral = np.concatenate([[0.0], np.cumsum(areas)])
        return RoughNumbers(POINTS_PER_LENGTH / self.correlation_m, heights, integral)


@compiled
def ridges_between(from_m, to_m, ridges):
    """Return the mean of the ridges' height over a way, in shares of the indentation.

    Over a way of no length it is the height there. A mean over the way of a step is what a
    sensor of limited bandwidth gets, also of ridges that pass too fast to be told apart.
    """
    middle = ridges.start_rad + ridges.wavenumber_rad_m * 0.5 * (from_m + to_m)
    half = 0.5 * ridges.wavenumber_rad_m * (to_m - from_m)
    total = 0.0
    for k in range(ridges.amplitudes.size):
        if ridges.amplitudes[k] == 0.0:
            continue
        share = (k + 1) * half
        mean = np.sin(share) / share if abs(share) > 1e-8 else 1.0
        total += ridges.amplitudes[k] * mean * np.sin((k + 1) * middle)
    return total


@compiled
def _cell(place, heights):
    """Return the four heights around a place (in points), and how far it is from the second."""
    n = heights.size
    below = np.floor(place)
    j = int(below) % n
    return heights[j - 1], heights[j], heights[(j + 1) % n], heights[(j + 2) % n], place - below


@compiled
def _height(place, rough):
    """Return the height at a place: the cubic through the points (Catmull-Rom)."""
    a, b, c, d, t = _cell(place, rough.heights)
    slope = c - a
    bend = 2.0 * a - 5.0 * b + 4.0 * c - d
    return b + 0.5 * t * (slope + t * (bend + t * (3.0 * (b - c) + d - a)))


@compiled
def _area(place, rough):
    """Return the integral of the height from point 0 to a place."""
    a, b, c, d, t = _cell(place, rough.heights)
    slope = c - a
    bend = 2.0 * a - 5.0 * b + 4.0 * c - d
    within = t * (b + t * (slope / 4.0 + t * (bend / 6.0 + t * (3.0 * (b - c) + d - a) / 8.0)))
    n = rough.heights.size
    # The profile has no mean, so whole turns of it add nothing.
    return rough.integral[int(np.floor(place)) % n] + within


@compiled
def roughness_between(from_m, to_m, rough):
    """Return the mean height over a way, in shares of the indentation; see ridges_between."""
    start, end = from_m * rough.per_m, to_m * rough.per_m
    if abs(end - start) < SHORT:
        return _height(0.5 * (start + end), rough)
    return (_area(end, rough) - _area(start, rough)) / (end - start)
