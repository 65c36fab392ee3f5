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

"""The skin over a taxel, and the friction between it and the surface that moves over it.

The skin is a spring and a damper that shear along x.

LuGre model (Canudas de Wit, Olsson, Astrom, Lischinsky 1995): bristles of deflection z under a
surface that moves with the velocity w against the skin,

    dz/dt = w - sigma0 |w| / g(w) z - r(z), F = sigma0 z + sigma1(w) (w - sigma0 |w| / g(w) z),
    g(w) = N (mu_k + (mu_s - mu_k) exp(-(w / v_s)^2))

with two additions:

- sigma1(w) = sigma1 / (1 + sigma1 |w| / g(w)): with a constant sigma1 the damper of the bristles
  would create energy where sigma1 |w| > 4 g(w). In Olsson 1996 sigma1 falls with w, too.
- r(z) = (z - clip(z, -Z, Z)) / tau with Z = mu_s N / sigma0: bristles that are bent further than
  the load can hold relax, even if nothing slides. Else they would hold a surface without load.
"""

import math

import numpy as np

from slip_detector.compiled import CompiledSet, compiled
from slip_detector.parameters import parameter


class Skin(CompiledSet):
    """Skin over one taxel, between the finger and the surface that it touches."""

    shear_stiffness_n_m: float = parameter(800.0, 'Shear stiffness.', (1e-3, 1e9, 'N/m'))
    damping_n_s_m: float = parameter(
        0.3, 'Damping against the finger; 0: none.', (0.0, 1e6, 'N s/m')
    )


#: Lower limit of the load in g(w), which must not be zero. A taxel does not sense the friction
#: under this load, which is less than a micronewton.
LIGHTEST_LOAD_N = 1e-6

#: Newton's method on a stage ends when an iteration changes the velocity by less than this share.
#: Each iteration squares the error, so that about the square of the share remains.
TOLERANCE = 1e-6

#: A sum of opposing forces below this share of them counts as zero.
ROUND_OFF = 1e-15

#: Unloaded skin counts as at rest when its displacement (m) and velocity (m/s) are below this.
AT_REST = 1e-15

#: Limit of Newton's iterations: ten times the largest number that was observed.
MOST_ITERATIONS = 200


class Friction(CompiledSet):
    """LuGre friction with Stribeck effect on the patch over each taxel."""

    model: str = parameter('lugre', 'Model of the friction: with bristles.', choices=('lugre',))
    kinetic_coefficient: float = parameter(
        0.56, 'Coefficient of friction while sliding.', (0.0, 10.0)
    )
    static_coefficient: float = parameter(0.61, 'Coefficient of friction at rest.', (0.0, 10.0))
    stribeck_velocity_m_s: float = parameter(
        10e-3,
        'Velocity at which 1 - 1/e of the fall to kinetic is done.',
        (1e-6, 1e3, 'm/s'),
    )
    bristle_stiffness_n_m: float = parameter(
        1e5, 'Stiffness of the bristles of a patch, sigma 0.', (1.0, 1e12, 'N/m')
    )
    bristle_damping_n_s_m: float = parameter(
        0.1, 'Damping of the bristles, sigma 1.', (0.0, 1e6, 'N s/m')
    )
    unloading_s: float = parameter(
        1e-4, 'Time in which bristles relax that the load cannot hold.', (1e-9, 1.0, 's')
    )

    def __post_init__(self) -> None:
        """Check the coefficients against each other."""
        super().__post_init__()
        kinetic, static = self.kinetic_coefficient, self.static_coefficient
        text = f'above 0 and at most static_coefficient, {static:g}'
        self.require(0.0 < kinetic <= static, 'kinetic_coefficient', text)

    def steepest_fall_n_s_m(self, load_n: float) -> float:
        """Return the steepest fall of sliding friction with velocity under a normal load.

        g(w) is steepest at w = v_s / sqrt(2).
        """
        drop_n = load_n * (self.static_coefficient - self.kinetic_coefficient)
        return drop_n * math.sqrt(2.0 / math.e) / self.stribeck_velocity_m_s


@compiled
def _bristle_stage(w, z, load, step, law):
    """Return force, deflection after an implicit step at constant w, and their slopes in w."""
    sigma0, sigma1 = law.bristle_stiffness_n_m, law.bristle_damping_n_s_m
    kinetic, static = law.kinetic_coefficient, law.static_coefficient
    ratio = w / law.stribeck_velocity_m_s
    drop = load * (static - kinetic) * np.exp(-ratio * ratio)
    level = load * kinetic + drop
    level_slope = -2.0 * drop * ratio / law.stribeck_velocity_m_s
    sign = 1.0 if w >= 0.0 else -1.0
    per_level = 1.0 / level
    share = sigma0 * per_level
    rate = share * abs(w)
    rate_slope = sign * share - rate * level_slope * per_level
    numerator, denominator = z + step * w, 1.0 + step * rate
    after = numerator / denominator
    most = static * load / sigma0
    if abs(after) > most:
        part = step / law.unloading_s
        numerator += part * (most if after > 0.0 else -most)
        denominator += part
        after = numerator / denominator
    after_slope = step * (1.0 - after * rate_slope) / denominator
    sliding = w - rate * after
    sliding_slope = 1.0 - rate_slope * after - rate * after_slope
    damping = sigma1 / (1.0 + sigma1 * abs(w) * per_level)
    damping_slope = -damping * damping * rate_slope / sigma0
    force = sigma0 * after + damping * sliding
    slope = sigma0 * after_slope + damping_slope * sliding + damping * sliding_slope
    return force, slope, after, after_slope


@compiled
def _guess(available, impedance, w, z, load, step, law):
    """Solve the stage with g and sigma1 fixed at a given w: a quadratic equation in w >= 0."""
    sigma0, sigma1 = law.bristle_stiffness_n_m, law.bristle_damping_n_s_m
    kinetic, static = law.kinetic_coefficient, law.static_coefficient
    ratio = w / law.stribeck_velocity_m_s
    drop = (static - kinetic) * np.exp(-ratio * ratio)
    per_level = 1.0 / (load * (kinetic + drop))
    damping = sigma1 / (1.0 + sigma1 * w * per_level)
    per = step * sigma0 * per_level
    b = available * per - impedance - step * sigma0
    b -= damping * (1.0 - sigma0 * z * per_level)
    c = max(available - sigma0 * z, 0.0)
    root = np.sqrt(b * b + 4.0 * impedance * per * c)
    return (b + root) / (2.0 * impedance * per) if b > 0.0 else 2.0 * c / (root - b)


@compiled
def lugre_stage(available, impedance, w_last, z, load, step, law):
    """Find the velocity w at which available - impedance w is the friction force.

    An implicit step solves this equation for each patch. w has the sign of the balance of forces
    at w = 0, and the balance has a zero on that side. So Newton's method between two bounds, with
    bisection where it would leave them, always finds w.

    Returns w, the force, its slope in w, and the deflection after the step.
    """
    load = max(load, LIGHTEST_LOAD_N)
    force, slope, at_rest, _ = _bristle_stage(0.0, z, load, step, law)
    balance = available - force
    round_off = ROUND_OFF * abs(available)
    if abs(balance) <= round_off:
        return 0.0, force, slope, at_rest
    sign = 1.0 if balance > 0.0 else -1.0
    near = max(sign * w_last, 0.0)
    speed = _guess(sign * available, impedance, near, sign * at_rest, load, step, law)
    low, high = 0.0, np.inf
    for _ in range(MOST_ITERATIONS):
        force, slope, after, after_slope = _bristle_stage(sign * speed, z, load, step, law)
        balance = sign * (available - force) - impedance * speed
        if balance > 0.0:
            low = speed
        else:
            high = speed
        steepness = impedance + slope
        change = balance / steepness if steepness > 0.0 else np.inf
        following = speed + change
        if abs(change) <= TOLERANCE * speed or abs(balance) <= round_off:
            # Newton's method converges quadratically: the next change would be negligible.
            change *= sign
            return sign * following, force + slope * change, slope, after + after_slope * change
        if not low < following < high:
            following = 0.5 * (low + high) if high < np.inf else 2.0 * speed + 1e-12
            if following in (low, high):
                break
        speed = following
    return sign * speed, force, slope, after


@compiled
def skin_stage(v, x, u, z, w_last, load, step, skin, law):
    """Advance one patch by one implicit step under a surface of velocity v.

    It solves c U + k X = F(w) with U = v - w and X, the displacement of the skin's surface. The
    velocity u before the step only tells whether the skin is at rest.

    Returns the velocity w of the surface against the skin, the friction force, its slope in v, and
    the bristles' deflection after the step.
    """
    if load == 0.0 and abs(x) < AT_REST and abs(u) < AT_REST:
        return v, 0.0, 0.0, 0.0
    impedance = skin.damping_n_s_m + skin.shear_stiffness_n_m * step
    available = skin.damping_n_s_m * v + skin.shear_stiffness_n_m * (x + step * v)
    w, force, slope, after = lugre_stage(available, impedance, w_last, z, load, step, law)
    # Friction and skin act in series.
    return w, force, slope * impedance / (slope + impedance), after
