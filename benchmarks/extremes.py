"""The simulated fingertip at its extremes: what stays finite and exact, and what is refused.

Each row is a short scene, run by the live stepper with its shipped step unless the row says
otherwise, and held against LSODA at a relative tolerance of 1e-9 (SciPy's, see
:mod:`benchmarks.scene_integrators`), itself held against BDF at 1e-8; where neither can do
it, against the live stepper with steps 16 times as short, and the row says so.

:func:`measure` gives one object (keys of ``slip_benchmark extremes --json``):

``extremes``
    One object a row: ``case``, ``setting``, ``method``; ``said``: the line with which it is
    refused before it starts, else empty, and then null for the rest; ``finite``: of all that came
    out; ``shear_share``: the largest shear of a taxel as a share of the static friction under the
    largest load it has had; ``volts_share``: the largest voltage as a share of what loads, ridges
    and friction allow; ``bounded``: both at most 1 (with mass the skin may overshoot: 2);
    ``energy_created``: by how much the energy stored in the friction has ever exceeded the work
    done on it, as a share of all work (a step's work and the energy it stores differ by up to
    0.05 sigma0 (h w)^2, which does not add up: the quadrature of a method of second order);
    ``voltage_error``: worst, as a share of the range of the
    reference's volts; ``position_error_m`` of an object until it is lost; ``reference``: its
    method; ``reference_error``: what its check differs by.
``hour``
    One hour of sliding forth and back, at rest in between: ``simulated_s``, ``cycles``,
    ``drift``: the largest difference of the volts of the last cycle from those of the second, as
    a share of their range; ``work_growth``: the same for the work of a cycle; ``finite`` and
    ``energy_created`` as above. With ``--quick`` it is a minute.
``wanted``
    For each claim its measured ``value``, the ``bound`` as text and whether it is ``met``.
"""

import math
import textwrap
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.command import Bound, verdicts
from benchmarks.scene_equations import Ode
from benchmarks.scene_integrators import (
    METHODS,
    GivenUpError,
    Solution,
    check,
    shows_shears,
    solve,
)
from slip_detector.scenes import Scene
from slip_detector.scenes.friction import LIGHTEST_LOAD_N
from slip_detector.scenes.mechanics import LEAST, WORK

Floats = NDArray[np.float64]

WANTED = {
    'extremes.not_finite_or_bounded': Bound('<=', 0.0),
    'extremes.energy_created': Bound('<=', 1e-9),
    'extremes.voltage_error': Bound('<=', 1e-2),
    'hour.drift': Bound('<=', 1e-6),
    'hour.work_growth': Bound('<=', 1e-6),
    'hour.energy_created': Bound('<=', 1e-9),
}

ALL = 10**9

#: References by method and tolerance, and the time each may take.
REFERENCES = (('LSODA', 1e-9), ('BDF', 1e-8))
REFERENCE_S = 12.0

#: Where no other method can be the reference, steps are so many times as short.
FINER = 16

#: Touched, held, slid over, held, let go.
STEPS = [
    {'duration_s': 0.05},
    {'duration_s': 0.05, 'force_n': 0.4},
    {'duration_s': 0.1},
    {'duration_s': 0.2, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.1},
    {'duration_s': 0.05, 'force_n': 0.0},
    {'duration_s': 0.05},
]

HOUR_S, MINUTE_S = 3600.0, 60.0
CYCLE = [
    {'duration_s': 0.5, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.5, 'velocity_m_s': 0.0},
    {'duration_s': 0.5, 'velocity_m_s': -6.7e-3},
    {'duration_s': 0.5, 'velocity_m_s': 0.0},
]
CYCLE_S = 2.0
HOUR_RATE_HZ = 125.0


class Case(NamedTuple):
    """One row: a scene that differs from the base by ``more``; a part of None is left out."""

    case: str
    setting: str
    more: Mapping[str, Any]
    method: str = 'live'
    of_quick: bool = True


def moving(*velocities_m_s: float, seconds: float = 0.1) -> list[dict[str, float]]:
    """Return steps that move with these velocities under a steady load."""
    push = [{'duration_s': seconds, 'velocity_m_s': v} for v in velocities_m_s]
    return [*STEPS[:3], *push, *STEPS[4:]]


def held(mass_kg: float) -> dict[str, Any]:
    """Return a scene in which an object is gripped, lifted, held and let slip."""
    grip_n = 1.5 * mass_kg * 9.80665 / (2 * 0.6)
    return {
        'steps': [
            {'duration_s': 0.1, 'force_n': grip_n},
            {'duration_s': 0.2},
            {'duration_s': 0.1, 'carried': 1.0},
            {'duration_s': 0.2},
            {'duration_s': 0.1, 'force_n': grip_n / 2},
            {'duration_s': 0.1},
            {'duration_s': 0.1, 'force_n': 0.0},
        ],
        'object': {'mass_kg': mass_kg},
        # A light grip is to reach the taxels too: a contact of 4 mm at least.
        'contact': {'radius_at_1n_m': max(5.4e-3, 4e-3 / grip_n ** (1 / 3))},
        'skin': {'damping_n_s_m': 1.0},
        'texture': None,
    }


#: No Stribeck effect, which needs damping against it.
EVEN = {'kinetic_coefficient': 0.6, 'static_coefficient': 0.6}
BARE = {'skin': {'mass_kg': 0.0, 'damping_n_s_m': 0.0}}
SMOOTH = {'electronics': {'bandwidth_hz': 150.0}}
LIFT_OFF = [
    *STEPS[:3],
    {'duration_s': 0.1, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.05, 'velocity_m_s': 6.7e-3, 'force_n': 0.0},
    {'duration_s': 0.1, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.05, 'velocity_m_s': 6.7e-3, 'force_n': 0.4},
    {'duration_s': 0.1, 'velocity_m_s': 6.7e-3},
    *STEPS[4:],
]


def cases() -> list[Case]:
    """Return all rows but the hour."""
    rows = [
        Case('bristles', f'sigma0 {s:.0e} N/m', {'friction': {'bristle_stiffness_n_m': s}})
        for s in (1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9)
    ]
    rows += [
        Case('bristles', 'sigma0 1e+09 N/m', {'friction': {'bristle_stiffness_n_m': 1e9}}, method)
        for method in ('RK45', 'DOP853')
    ]
    rows += [
        Case('lift-off', 'while it slides', {'steps': LIFT_OFF}),
        Case(
            'lift-off', 'bouncing', {'steps': LIFT_OFF, 'motion': {'ringing_damping': 0.03}}
        ),
        Case(
            'lift-off', 'relieved by taps',
            {'taps': {'times_s': [0.25, 0.3, 0.35], 'peak_force_n': -1.0}},
        ),
        Case(
            'reversal', '20 mm/s, 2 m/s2',
            {
                'steps': moving(20e-3, -20e-3, 20e-3, -20e-3),
                'motion': {'acceleration_m_s2': 2.0}, **SMOOTH,
            },
        ),
        Case(
            'reversal', '20 mm/s, 1000 m/s2',
            {
                'steps': moving(20e-3, -20e-3, 20e-3, -20e-3),
                'motion': {'acceleration_m_s2': 1000.0}, **SMOOTH,
            },
        ),
        Case(
            'no mass, no damping', 'no Stribeck effect',
            {**BARE, 'friction': {**EVEN, 'bristle_damping_n_s_m': 0.0}},
        ),
        *(
            Case(
                'no mass, no damping',
                'no Stribeck effect',
                {**BARE, 'friction': {**EVEN, 'bristle_damping_n_s_m': 0.0}},
                method,
            )
            for method in ('LSODA', 'BDF', 'Radau')
        ),
        Case(
            'no mass, no damping', 'damped bristles',
            {**BARE, 'friction': EVEN},
        ),
        Case('no mass, no damping', 'Stribeck effect', {'skin': {'damping_n_s_m': 0.0}}),
        Case(
            'no mass', 'no bristle damping', {'friction': {'bristle_damping_n_s_m': 0.0}}
        ),
        Case(
            'no damping', 'mass 1e-5 kg',
            {'skin': {'mass_kg': 1e-5, 'damping_n_s_m': 0.0}, 'friction': EVEN}, of_quick=False,
        ),
        Case('mass', '1e-5 kg', {'skin': {'mass_kg': 1e-5}}),
        Case('mass', '1e-8 kg', {'skin': {'mass_kg': 1e-8}}, of_quick=False),
    ]  # fmt: skip
    rows += [
        Case('sample rate', f'{rate:g} Hz', {'sample_rate_hz': rate})
        for rate in (500.0, 5000.0, 50_000.0)
    ]
    low_pass = {'electronics': {'bandwidth_hz': 20.0}}
    rows.append(Case('sample rate', '50 Hz, 20 Hz low-pass', {'sample_rate_hz': 50.0, **low_pass}))
    rows += [
        Case(
            'spatial period', f'{period * 1e6:g} um, 150 Hz',
            {'texture': {'spatial_period_m': period}, **SMOOTH}, of_quick=period > 1e-5,
        )
        for period in (1e-4, 1e-5, 1e-6)
    ]  # fmt: skip
    fast = {'steps': moving(80e-3, seconds=0.2), 'motion': {'acceleration_m_s2': 2.0}}
    rows += [
        Case('spatial period', '1 um, no low-pass', {'texture': {'spatial_period_m': 1e-6}}),
        Case('velocity', '80 mm/s, 150 Hz', {**fast, **SMOOTH}),
        Case('velocity', '80 mm/s, no low-pass', fast),
    ]
    rows += [
        Case('object', f'{mass * 1e3:g} g', held(mass), of_quick=mass == 0.2)
        for mass in (1e-3, 1e-2, 0.2, 1.0, 10.0)
    ]
    rows.append(Case('coulomb', 'texture', {'friction': 'coulomb'}))
    rows += [Case('coulomb', 'texture', {'friction': 'coulomb'}, method) for method in METHODS]
    return rows


def described(case: Case) -> dict[str, Any]:
    """Return the description of a row's scene."""
    whole = {'steps': STEPS, 'friction': {}, 'texture': {}} | dict(case.more)
    return {name: part for name, part in whole.items() if part is not None}


def fresh(description: Mapping[str, Any], **more: Any) -> Scene:
    """Build a scene; all are of one trial."""
    return Scene({**description, **more}, np.random.default_rng(0))


def measure(quick: bool = False) -> dict[str, Any]:
    """Run all rows; the keys are in the module's docstring."""
    rows = [run(case) for case in cases() if case.of_quick or not quick]
    hour = long_run(MINUTE_S if quick else HOUR_S)
    done = [row for row in rows if not row['said']]
    values: dict[str, float] = {
        'extremes.not_finite_or_bounded': float(
            sum(not (row['finite'] and row['bounded']) for row in done)
        ),
        'extremes.energy_created': max(row['energy_created'] for row in done),
        'extremes.voltage_error': max(row['voltage_error'] for row in done),
    } | {f'hour.{name}': hour[name] for name in ('drift', 'work_growth', 'energy_created')}
    return {'extremes': rows, 'hour': hour, 'wanted': verdicts(WANTED, values)}


def run(case: Case, with_reference: bool = True) -> dict[str, Any]:
    """Run one row; without a reference errors are null."""
    row: dict[str, Any] = {
        'case': case.case, 'setting': case.setting, 'method': case.method, 'said': '',
        'finite': None, 'bounded': None, 'shear_share': None, 'volts_share': None,
        'energy_created': None, 'voltage_error': None, 'position_error_m': None,
        'reference': None, 'reference_error': None,
    }  # fmt: skip
    description = described(case)
    try:
        scene = fresh(description)
        if case.method != 'live':
            check(Ode(scene), case.method, (0.0, scene.duration_s))
            raise RuntimeError(f'{case.method} was to refuse {case.case}, {case.setting}')
    except ValueError as error:
        return row | {'said': str(error)}
    ledger = np.zeros(3)
    _, clean_v, position_m, sliding = scene.clean(ALL, ledger)
    sheared = fresh(shows_shears(description, scene))
    _, shear_n, _, _ = sheared.clean(ALL)
    finite = all(np.isfinite(a).all() for a in (clean_v, position_m, sliding, shear_n, ledger))
    shear_share, volts_share = _shares(scene, clean_v, shear_n)
    most = 2.0 if scene.plan.skin.mass_kg > 0.0 else 1.0 + 1e-6
    row |= {
        'finite': bool(finite),
        'bounded': bool(max(shear_share, volts_share) <= most),
        'shear_share': shear_share,
        'volts_share': volts_share,
        'energy_created': _created(ledger),
    }
    if not with_reference:
        return row
    solution, row['reference'], row['reference_error'] = _reference(description)
    n = min(len(clean_v), len(solution.clean_v))
    difference_v = np.abs(clean_v[:n] - solution.clean_v[:n]).max()
    row['voltage_error'] = float(difference_v / np.ptp(solution.clean_v))
    if 'object' in scene.parts:
        far_m = np.abs(position_m[:n] - solution.position_m[:n])
        row['position_error_m'] = float(far_m.max())
    return row


def _reference(description: Mapping[str, Any]) -> tuple[Solution, str, float | None]:
    """Return a reference, its name, and what its check differs by."""
    found: list[tuple[Solution, str]] = []
    try:
        ode = Ode(fresh(description))
        for method, rtol in REFERENCES:
            try:
                found.append((solve(ode, method, rtol, budget_s=REFERENCE_S), method))
            except (GivenUpError, RuntimeError):  # The other one may do it.
                continue
    except ValueError:  # No differential equation says it.
        pass
    if not found:
        scene = fresh(description)
        times_s, clean_v, position_m, _ = fresh(
            description, step_s=scene.plan.step_s / FINER
        ).clean(ALL)
        nothing = np.zeros(0)
        finer = Solution(
            times_s, clean_v, position_m, nothing, math.inf, nothing, 0.0, len(times_s), 0
        )
        return finer, f'live, steps / {FINER}', None
    solution, name = found[0]
    if len(found) == 1:
        return solution, name, None
    other = found[1][0].clean_v
    n = min(len(other), len(solution.clean_v))
    gap_v = np.abs(other[:n] - solution.clean_v[:n]).max()
    return solution, name, float(gap_v / np.ptp(solution.clean_v))


def _created(ledger: Floats) -> float:
    """Return by how much friction gave more than it got, as a share of the work done on it."""
    return max(0.0, -float(ledger[LEAST])) / max(float(ledger[WORK]), 1e-300)


def _shares(scene: Scene, clean_v: Floats, shear_n: Floats) -> tuple[float, float]:
    """Return the largest shear and voltage as shares of what contact and friction allow."""
    plan = scene.plan
    times_s = np.linspace(0.0, scene.duration_s, 4001)
    force_n = float(scene.force_n(times_s).max())
    load_n = scene.contact.largest_load_n(1.001 * force_n) + LIGHTEST_LOAD_N
    coefficient = plan.friction.static if plan.friction.static else plan.friction.kinetic
    friction_n = max(coefficient, plan.friction.kinetic) * load_n
    ridges = float(np.abs(plan.ridges.amplitudes).sum())
    most_v = np.abs(plan.normal_v_n) * load_n * (1.0 + ridges)
    most_v = most_v + np.abs(plan.shear_v_n) * friction_n
    return (
        float(np.abs(shear_n).max()) / friction_n,
        float((np.abs(clean_v).max(axis=0) / most_v).max()),
    )


def long_run(simulated_s: float) -> dict[str, Any]:
    """Slide forth and back for long, and compare the last cycle with the second."""
    cycles = round(simulated_s / CYCLE_S) - 1
    begin = [{'duration_s': 0.5, 'force_n': 0.4}, {'duration_s': CYCLE_S - 0.5}]
    scene = fresh(
        {
            'steps': [*begin, *(CYCLE * cycles)],
            'friction': {},
            'texture': {},
            'sample_rate_hz': HOUR_RATE_HZ,
        }
    )
    per_cycle = round(CYCLE_S * HOUR_RATE_HZ)
    ledger = np.zeros(3)
    finite = True
    volts, works = [], []
    for _ in range(scene.length // per_cycle):
        before = ledger[WORK]
        _, clean_v, _, _ = scene.clean(per_cycle, ledger)
        finite &= bool(np.isfinite(clean_v).all() and np.isfinite(ledger).all())
        volts.append(clean_v)
        works.append(float(ledger[WORK] - before))
    second_v, last_v = volts[2], volts[-1]
    return {
        'simulated_s': scene.duration_s,
        'cycles': cycles,
        'finite': finite,
        'drift': float(np.abs(last_v - second_v).max() / np.ptp(second_v)),
        'work_growth': abs(works[-1] - works[2]) / works[2],
        'energy_created': _created(ledger),
    }


def table(result: dict[str, Any]) -> str:
    """Return what :func:`measure` gave as text, at most 99 columns wide."""
    lines = [
        f'{"case":<20}{"setting":<22}{"method":<8}{"finite,":>8}{"energy":>9}{"volts":>9}'
        f'{"object":>9} reference',
        f'{"":<20}{"":<22}{"":<8}{"bounded":>8}{"created":>9}{"error":>9}{"m":>9} and its check',
    ]
    said: dict[str, int] = {}
    for row in result['extremes']:
        start = f'{row["case"]:<20}{row["setting"]:<22}{row["method"]:<8}'
        if row['said']:
            said.setdefault(row['said'], len(said) + 1)
            lines.append(f'{start}refused, see {said[row["said"]]}')
            continue
        sound = 'yes' if row['finite'] and row['bounded'] else 'NO'
        check = row['reference_error']
        far = row['position_error_m']
        lines.append(
            f'{start}{sound:>8}{row["energy_created"]:>9.0e}{row["voltage_error"]:>9.1e}'
            f'{"-" if far is None else format(far, ".1e"):>9} {row["reference"]}'
            + ('' if check is None else f' {check:.0e}')
        )
    for text, number in said.items():
        lines += ['', *textwrap.wrap(f'{number}: {text}', 99, subsequent_indent='   ')]
    hour = result['hour']
    lines += [
        '',
        f'{hour["simulated_s"]:g} s of sliding forth and back ({hour["cycles"]} cycles): '
        f'{"all finite" if hour["finite"] else "NOT FINITE"};',
        f'the last cycle differs from the second by {hour["drift"]:.1e} of the range, its work by '
        f'{hour["work_growth"]:.1e};',
        f'energy created {hour["energy_created"]:.0e}',
        '',
        'Wanted',
    ]
    for claim, verdict in result['wanted'].items():
        met = 'met' if verdict['met'] else 'NOT MET'
        lines.append(f'  {claim:<32}{verdict["value"]:>9.2g}  {verdict["bound"]:<9} {met}')
    return '\n'.join(lines)
