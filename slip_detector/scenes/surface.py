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

"""What the fingertip touches: the contact, the object in the grip, ridges and roughness."""

from typing import NamedTuple

import numpy as np

from slip_detector.chain.samples import Floats
from slip_detector.compiled import CompiledSet, compiled
from slip_detector.parameters import ParameterSet, parameter

STANDARD_GRAVITY_M_S2 = 9.80665

#: Number of equal fingertips that hold an object.
FINGERS = 2.0


class Contact(CompiledSet):
    """Hertz contact of a round fingertip with a plate."""

    radius_at_1n_m: float = parameter(
        5.4e-3, 'Contact radius at 1 N; grows with the cube root of the force.', (1e-5, 1.0, 'm')
    )
    taxel_area_m2: float = parameter(
        1.39e-6, 'Area over which a taxel senses pressure.', (1e-12, 1.0, 'm2')
    )

    def largest_load_n(self, force_n: float) -> float:
        """Return the largest load of a taxel: that of one at the centre of the contact."""
        out = np.zeros(1)
        spread_load(force_n, 0.0, 0.0, np.zeros((1, 2)), self.numbers(), 0.0, out)
        return float(out[0])


@compiled
def spread_load(force_n, centre_x_m, centre_y_m, positions_m, contact, rest_patches, loads_n):
    """Write the normal load of each taxel to ``loads_n``.

    Hertz: p(r) = 3 F / (2 pi a^2) sqrt(1 - r^2 / a^2), a^3 proportional to F.

    An extra element of ``loads_n`` gets the load of one of the ``rest_patches`` of skin between
    the taxels, which together carry the rest of the force.
    """
    n = positions_m.shape[0]
    if not force_n > 0.0:
        loads_n[:] = 0.0
        return
    squared = contact.radius_at_1n_m**2 * force_n ** (2.0 / 3.0)
    peak = 1.5 * force_n / (np.pi * squared) * contact.taxel_area_m2
    carried = 0.0
    for i in range(n):
        x, y = positions_m[i, 0] - centre_x_m, positions_m[i, 1] - centre_y_m
        inside = 1.0 - (x * x + y * y) / squared
        loads_n[i] = peak * np.sqrt(inside) if inside > 0.0 else 0.0
        carried += loads_n[i]
    if loads_n.size > n:
        loads_n[n] = max(force_n - carried, 0.0) / rest_patches


class FreeObject(CompiledSet):
    """An object between two equal fingertips, one of which has the sensor."""

    mass_kg: float = parameter(0.2, 'Mass of the object.', (1e-3, 10.0, 'kg'))
    length_m: float = parameter(
        0.1, 'How far it can slide through the fingers before it is lost.', (1e-4, 10.0, 'm')
    )
    rest_patches: float = parameter(
        50.0, 'Number of further patches of skin between the taxels, as stiff.', (1.0, 1e4)
    )


class RidgeNumbers(NamedTuple):
    """The numbers of a :class:`Texture` for compiled code; no amplitudes without ridges."""

    wavenumber_rad_m: float = 0.0
    start_rad: float = 0.0
    amplitudes: Floats = np.zeros(0)


class Texture(ParameterSet):
    """Ridges across the direction of motion."""

    spatial_period_m: float = parameter(400e-6, 'Distance from ridge to ridge.', (1e-6, 1.0, 'm'))
    ridge_height_m: float = parameter(
        100e-6, 'Height of the first harmonic above the mean.', (0.0, 1e-2, 'm')
    )
    harmonics: tuple[float, ...] = parameter(
        (0.0, -0.22),
        'Heights of the second, third, ... harmonic as shares of the first; [] for a sine.',
        (-10.0, 10.0),
    )
    indentation_m: float = parameter(
        670e-6, 'Height that doubles the load of the taxel on it.', (1e-9, 1.0, 'm')
    )

    def __post_init__(self) -> None:
        """Check that the load of a taxel does not become negative in a groove."""
        super().__post_init__()
        highest_m = self.ridge_height_m * (1.0 + sum(map(abs, self.harmonics)))
        text = f'with its harmonics at most indentation_m, {self.indentation_m:g} m'
        self.require(highest_m <= self.indentation_m, 'ridge_height_m', text)

    def ridges(self, trial: np.random.Generator) -> RidgeNumbers:
        """Return the numbers for compiled code; ``trial`` draws where on the plate they begin."""
        heights = self.ridge_height_m * np.array([1.0, *self.harmonics])
        return RidgeNumbers(
            2.0 * np.pi / self.spatial_period_m,
            2.0 * np.pi * trial.random(),
            heights / self.indentation_m,
        )


@compiled
def ridges_between(from_m, to_m, ridges):
    """Return the mean height of the ridges between two places, as a share of the indentation.

    If both places are equal, the result is the height there. A sensor of limited bandwidth reads
    the mean over the distance of a step, even if ridges pass too fast to be resolved.
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


#: Points of the profile in a correlation length and in the whole profile, which then repeats.
POINTS_PER_LENGTH = 8
PROFILE_POINTS = 8192

#: For a distance below this share of the points' spacing the height in the middle is the mean.
SHORT = 1e-3


class RoughNumbers(NamedTuple):
    """The numbers of a :class:`Roughness` for compiled code; no heights without roughness.

    ``per_m`` are the points of the profile in a metre, ``heights`` are shares of the indentation,
    and ``integral``, one element longer, is that of the heights from the first point to each.
    """

    per_m: float = 0.0
    heights: Floats = np.zeros(0)
    integral: Floats = np.zeros(0)


class Roughness(ParameterSet):
    """A flat surface with a random profile, Gaussian with a Gaussian correlation."""

    height_rms_m: float = parameter(0.2e-6, 'Standard deviation of the height.', (0.0, 1e-2, 'm'))
    correlation_m: float = parameter(50e-6, 'Correlation length of the profile.', (1e-9, 1.0, 'm'))
    indentation_m: float = parameter(
        670e-6, 'Height that doubles the load of the taxel on it.', (1e-9, 1.0, 'm')
    )
    surface_seed: int = parameter(
        1, 'Seed of the profile; each seed is another surface.', (0, 2**31 - 1)
    )

    def profile(self) -> RoughNumbers:
        """Return the numbers for compiled code."""
        noise = np.random.default_rng(self.surface_seed).standard_normal(PROFILE_POINTS)
        # White noise through this Gaussian filter has the correlation exp(-(distance / length)^2).
        cycles = np.fft.rfftfreq(PROFILE_POINTS) * POINTS_PER_LENGTH
        profile = np.fft.irfft(np.fft.rfft(noise) * np.exp(-0.5 * np.square(np.pi * cycles)))
        profile -= profile.mean()
        heights = profile * (self.height_rms_m / self.indentation_m / profile.std())
        # Area under the Catmull-Rom cubic of four neighbours, between the second and the third.
        before, after, next_after = (np.roll(heights, places) for places in (1, -1, -2))
        areas = (13.0 * (heights + after) - before - next_after) / 24.0
        integral = np.concatenate([[0.0], np.cumsum(areas)])
        return RoughNumbers(POINTS_PER_LENGTH / self.correlation_m, heights, integral)


@compiled
def _cubic(place, heights):
    """Return the Catmull-Rom cubic of the four points around a place.

    The result is the number of the point below the place, the height of that point, twice the
    factors of t, t^2 and t^3 in the cubic, and t, the distance of the place from that point.
    """
    n = heights.size
    below = np.floor(place)
    j = int(below) % n
    a, b, c, d = heights[j - 1], heights[j], heights[(j + 1) % n], heights[(j + 2) % n]
    return j, b, c - a, 2.0 * a - 5.0 * b + 4.0 * c - d, 3.0 * (b - c) + d - a, place - below


@compiled
def _height(place, rough):
    """Return the height at a place."""
    _, height, slope, bend, twist, t = _cubic(place, rough.heights)
    return height + 0.5 * t * (slope + t * (bend + t * twist))


@compiled
def _area(place, rough):
    """Return the integral of the height from point 0 to a place."""
    j, height, slope, bend, twist, t = _cubic(place, rough.heights)
    within = t * (height + t * (slope / 4.0 + t * (bend / 6.0 + t * twist / 8.0)))
    # The mean of the profile is zero, so whole repetitions of it add nothing.
    return rough.integral[j] + within


@compiled
def roughness_between(from_m, to_m, rough):
    """Return the mean height between two places, or that at one, as a share of the indentation."""
    start, end = from_m * rough.per_m, to_m * rough.per_m
    if abs(end - start) < SHORT:
        return _height(0.5 * (start + end), rough)
    return (_area(end, rough) - _area(start, rough)) / (end - start)
