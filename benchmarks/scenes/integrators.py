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

"""A scene solved by SciPy's integrators, with which the live stepper is compared."""

import math
import time
import warnings
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, optimize

from benchmarks.scenes.ode import Ode
from slip_detector.scenes import Scene

Floats = NDArray[np.float64]

EXPLICIT = ('RK45', 'DOP853')
IMPLICIT = ('LSODA', 'BDF', 'Radau')
INTEGRATORS = (*EXPLICIT, *IMPLICIT)

#: Longest stable step of an explicit method, as a multiple of the time in which bristles settle:
#: where its region of stability ends on the real axis.
EXPLICIT_REACH = {'RK45': 3.3, 'DOP853': 6.0}

#: An explicit method that needs more steps is refused: they would take over ten minutes.
MOST_EXPLICIT_STEPS = 5e6

#: A taxel has begun to slip when the surface has passed this much further over it than at the
#: start of the motion.
ONSET_M = 10e-6

#: Steps of the live stepper that are kept in memory at a time.
ROWS_PER_READ = 20_000


class Solution(NamedTuple):
    """The solution of a scene by an integrator.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
    clean_v : ndarray, shape (n, 16)
    position_m : ndarray, shape (n,)
    onset_s : ndarray, shape (16,)
        When each taxel began to slip; NaN for one that did not.
    lost_s : float
        When the object was lost, where the solution ends; infinite when it was not lost.
    states : ndarray, shape (n, states)
    run_time_s : float
        Processor time.
    steps, calls : int
        Number of the method's steps, and of its evaluations of the rates.
    """

    time_s: Floats
    clean_v: Floats
    position_m: Floats
    onset_s: Floats
    lost_s: float
    states: Floats
    run_time_s: float
    steps: int
    calls: int


class BudgetSpentError(RuntimeError):
    """A method has used up its processor time."""


def refuse_impossible(ode: Ode, method: str, span_s: tuple[float, float]) -> None:
    """Refuse a method that cannot solve the scene, before it starts.

    Raises
    ------
    ValueError
        For an unknown method, and for an explicit one that would need too many steps.
    """
    if method not in INTEGRATORS:
        raise ValueError(f'unknown method {method}, allowed: {", ".join(INTEGRATORS)}')
    if not ode.size:
        raise ValueError(
            'the scene has no friction and no low-pass: its volts are a closed form of the '
            'time; allowed: scenes with one of them'
        )
    if method in EXPLICIT and ode.constants.patches.size:
        mean, most = ode.stiffness_1_s(span_s)
        steps = mean * (span_s[1] - span_s[0]) / EXPLICIT_REACH[method]
        if steps > MOST_EXPLICIT_STEPS:
            raise ValueError(
                f'{method}: would need about {steps:.1e} steps, as bristles settle in down to '
                f'{1.0 / most:.1e} s; allowed: up to {MOST_EXPLICIT_STEPS:g} steps, or LSODA, '
                'BDF, Radau and the live stepper'
            )


def solve(
    ode: Ode,
    method: str,
    rtol: float,
    span: tuple[int, int] | None = None,
    start: Floats | None = None,
    budget_s: float = math.inf,
) -> Solution:
    """Integrate a scene; the method starts again at each corner of its drive.

    The absolute tolerance of each state is ``rtol`` times its scale.

    Parameters
    ----------
    ode
        The differential equation.
    method
        One of :data:`INTEGRATORS`.
    rtol
        Relative tolerance.
    span
        First and last sample; None: all samples.
    start : ndarray, shape (size,), optional
        State at the first sample.
    budget_s
        Processor time after which to give up.

    Raises
    ------
    ValueError
        When the method cannot solve the scene; raised before anything is computed.
    BudgetSpentError
        When the time is used up.
    RuntimeError
        When the method fails or its states are not finite.
    """
    scene = ode.scene
    rate_hz = scene.true_rate_hz
    first, last = span or (0, scene.length - 1)
    time_s = np.arange(first, last + 1) / rate_hz
    refuse_impossible(ode, method, (time_s[0], time_s[-1]))
    begin_s = time.thread_time()
    y = ode.start() if start is None else start.copy()
    states = np.empty((len(time_s), ode.size))
    states[0] = y
    inside = ode.corners_s()
    inside = inside[(inside > time_s[0]) & (inside < time_s[-1])]
    pieces = np.concatenate([time_s[:1], inside, time_s[-1:]])
    moving_s = ode.moving_s()
    x_at = ode.own_at if ode.constants.patches.size else None
    onset_s = np.full(len(ode.own_at), np.nan)
    at_start_m: Floats | None = None
    lost_s, steps, calls, done = math.inf, 0, 0, 1
    pairs = zip(pieces[:-1].tolist(), pieces[1:].tolist(), strict=True)
    for begin, end in pairs:
        if lost_s < math.inf:
            break
        ode.side_s = 0.5 * (begin + end)
        if x_at is not None and at_start_m is None and begin >= moving_s:
            at_start_m = ode.position_m(begin, y) - y[x_at]
        solver = _solver(ode, method, rtol, begin, y, end)
        while solver.status == 'running' and lost_s == math.inf:
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')
                message = solver.step()
            steps += 1
            if solver.status == 'failed' or not np.isfinite(solver.y).all():
                raise RuntimeError(f'{method}: failed at {solver.t:g} s: {message}')
            if not steps % 50 and time.thread_time() - begin_s > budget_s:
                raise BudgetSpentError(f'{method}: given up after {budget_s:g} s')
            dense, stop = None, solver.t
            if ode.with_object and solver.y[-2] > ode.constants.body.length_m:
                dense = solver.dense_output()
                stop = lost_s = _crossing(
                    dense, solver, lambda t, y: float(y[-2]) - ode.constants.body.length_m
                )
            if done < len(time_s) and time_s[done] <= stop:
                dense = dense or solver.dense_output()
                until = int(np.searchsorted(time_s, stop, side='right'))
                states[done:until] = dense(time_s[done:until]).T
                done = until
            if x_at is not None and at_start_m is not None and np.isnan(onset_s).any():
                passed_m = ode.position_m(solver.t, solver.y) - solver.y[x_at] - at_start_m
                for c in np.flatnonzero((np.abs(passed_m) >= ONSET_M) & np.isnan(onset_s)):
                    dense = dense or solver.dense_output()
                    onset_s[c] = _crossing(
                        dense,
                        solver,
                        lambda t, y, i=x_at[c], start_m=at_start_m[c]: (
                            abs(ode.position_m(t, y) - y[i] - start_m) - ONSET_M
                        ),
                    )
        calls += solver.nfev
        y = solver.y
    time_s, states = time_s[:done], states[:done]
    clean_v, position_m = ode.volts(time_s, states)
    run_time_s = time.thread_time() - begin_s
    return Solution(time_s, clean_v, position_m, onset_s, lost_s, states, run_time_s, steps, calls)


def _crossing(dense: Any, solver: Any, far: Callable[..., float]) -> float:
    """Return when, within the last step, a quantity rose above zero."""
    first, last = float(solver.t_old), float(solver.t)
    if far(first, dense(first)) >= 0.0:
        return first
    if far(last, dense(last)) <= 0.0:
        return last
    return float(optimize.brentq(lambda t: far(t, dense(t)), first, last, xtol=1e-13, rtol=1e-15))


def _solver(ode: Ode, method: str, rtol: float, t: float, y: Floats, end: float) -> Any:
    """Make SciPy's solver, with the Jacobian or its bands if it accepts them."""
    options: dict[str, Any] = {'rtol': rtol, 'atol': rtol * ode.scales}
    if method in ('BDF', 'Radau') or (method == 'LSODA' and ode.with_object):
        options['jac'] = ode.jacobian
    elif method == 'LSODA':
        options |= ode.bands()
    return getattr(integrate, method)(ode.rates, t, y, end, **options)


def live_onset_s(scene: Scene, ode: Ode) -> Floats:
    """Return when each taxel begins to slip in the live stepper.

    Parameters
    ----------
    scene
        A scene of :func:`showing_shears`, nothing of which has been read; each of its samples is
        one step.
    ode
        The differential equation of the same scene.

    Returns
    -------
    ndarray, shape (16,)
        NaN for a taxel that does not slip.
    """
    onset_s = np.full(len(ode.own_at), np.nan)
    moving_s = ode.moving_s()
    at_start: Floats | None = None
    before: tuple[float, Floats] | None = None
    stiffness_n_m = scene.constants.skin.stiffness_n_m
    while math.isfinite(moving_s):
        time_s, shear_n, position_m, _ = scene.clean(ROWS_PER_READ)
        if not len(time_s):
            break
        passed_m = position_m[:, np.newaxis] - shear_n / stiffness_n_m
        if at_start is None and time_s[-1] >= moving_s:
            at_start = passed_m[np.searchsorted(time_s, moving_s - 1e-12)]
        if at_start is not None:
            gone_m = np.abs(passed_m - at_start)
            gone_m[time_s < moving_s - 1e-12] = 0.0
            for c in np.flatnonzero(np.isnan(onset_s)):
                i = int(np.argmax(gone_m[:, c] >= ONSET_M))
                if gone_m[i, c] < ONSET_M:
                    continue
                t0, g0 = 0.0, 0.0
                if i:
                    t0, g0 = time_s[i - 1], gone_m[i - 1, c]
                elif before:
                    t0, g0 = before[0], before[1][c]
                share = (ONSET_M - g0) / (gone_m[i, c] - g0)
                onset_s[c] = t0 + share * (time_s[i] - t0)
            before = (float(time_s[-1]), gone_m[-1])
            if not np.isnan(onset_s).any():
                break
    return onset_s


def showing_shears(description: Mapping[str, Any], scene: Scene) -> dict[str, Any]:
    """Return the same scene with the shears as its volts, and one sample for each step."""
    steps_hz = scene.constants.steps_per_sample * scene.sample_rate_hz
    kept = {
        name: part for name, part in description.items() if name not in ('texture', 'roughness')
    }
    shears = {'normal_v_n': 0.0, 'shear_v_n': 1.0, 'shear_along_share': 1.0, 'spread': 0.0}
    return kept | {
        'electronics': shears,
        'sample_rate_hz': steps_hz,
        'step_s': min(1.0, 1.5 / steps_hz),
    }
