"""Error against run time of the scenes, for the live stepper and SciPy's integrators.

The reference of each scene is a tight-tolerance implicit solution, held against a second method.
Voltage errors are the worst over samples and channels, as a share of the range of the
reference's volts (clean: without baselines, noise and faults); an onset is when the surface has
passed 10 um further over a taxel than at the start of the motion; the object's position is that
until it is lost. Run times are of the processor, on one core, without compiling, with all that
makes the volts of the samples; those of SciPy's methods with the equations, their Jacobian and
their drive compiled, and tolerances in shares of each state's own scale.

What a method cannot do in its budget over the whole scene it does over a stretch of it about the
start of the motion, from the reference's state on; explicit methods do only that, as the stiff
bristles bind their steps everywhere.

:func:`measure` gives one object (keys of ``slip_benchmark scenes --json``):

``precision``
    One object for each scene: ``scene``, ``simulated_s``, ``states`` (of the differential
    equation), ``note`` (why there is nothing to compare, else empty), ``range_v``, ``reference``
    with ``method``, ``check``, ``rtol`` and the differences of the two: ``voltage_error``,
    ``onset_error_s``, ``position_error_m``; and ``runs``: ``method`` (``live`` is the live
    stepper), ``setting``, ``over`` (seconds from, to), ``voltage_error``, ``onset_error_s``,
    ``position_error_m``, ``position_error`` (relative to its way), ``run_time_per_s`` (for a
    simulated second), ``steps``, and ``said``: the line with which a method refused or gave up,
    with null for the figures. An error is null where the scene has none such. ``shipped_live`` is
    the run of the live stepper with the step that the scene has. ``front`` has ``ratio``, the
    largest of the live stepper's time over that of another method at the same error, where that
    is 1e-3 or more, and ``against``, which run that was; null where the references differ by more.
``costs``
    One object for each scene: ``scene``, ``parts``, ``run_time_per_s`` of all of it, noise
    included, ``speed`` (times real time), and ``without``: by part ``share``, the time
    without it as a share of the whole's, or ``said``, the line with which the scene is refused
    without it.
``pace``
    Of the plate: ``rows`` of a read, ``slowest_share``, the slowest read's time as a share of
    the time that its rows last, and ``mean_share``.
``wanted``
    For each claim its measured ``value``, the ``bound`` as text and whether it is ``met``.
"""

import math
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.command import Bound, gc_off, verdicts
from benchmarks.scene_equations import Ode
from benchmarks.scene_integrators import (
    EXPLICIT,
    GivenUpError,
    Solution,
    live_onset_s,
    shows_shears,
    solve,
)
from slip_detector.parameters.files import shared_folder
from slip_detector.parameters.sets import read_yaml
from slip_detector.scenes import Scene, find_scene
from slip_detector.scenes.motion import LoadNumbers
from slip_detector.scenes.parts import PARTS

Floats = NDArray[np.float64]

WANTED = {
    'front.ratio': Bound('<=', 1.0),
    'plate.speed': Bound('>=', 50.0),
    'pace.slowest_share': Bound('<', 1.0),
    'costs.largest_share': Bound('<', 1.0),
}

#: The scene for which speed and pace are wanted.
PLATE = 'plate_400um'

#: From this error on the live stepper is wanted to be on the front.
FRONT_ERROR = 1e-3

#: Live drivers read so many rows at most in one go.
PACE_ROWS = 32

#: What a part costs is measured in pieces of so many rows.
PIECE_ROWS = 95

#: Of the stretch: so much before the start of the motion and after it.
STRETCH_S = (0.02, 0.18)

#: What is always there; leaving it out gives it defaults.
ALWAYS = ('motion', 'contact', 'skin', 'electronics')

REFERENCES = (('BDF', 1e-10), ('LSODA', 1e-10), ('Radau', 1e-9))


class Sizes(NamedTuple):
    """How much is measured.

    Attributes
    ----------
    tolerances : tuple of float
        Of the methods that do whole scenes.
    explicit_tolerances : tuple of float
    steps_per_sample : tuple of int
        Of the live stepper.
    rounds : int
        How often what is fast is repeated.
    budget_s, stretch_budget_s : float
        For a method to do a scene, and a stretch.
    cost_rounds : int
    """

    tolerances: tuple[float, ...]
    explicit_tolerances: tuple[float, ...]
    steps_per_sample: tuple[int, ...]
    rounds: int
    budget_s: float
    stretch_budget_s: float
    cost_rounds: int


FULL = Sizes(
    (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8),
    (1e-3, 1e-5),
    (1, 2, 3, 4, 6, 8, 16, 32, 64),
    5,
    4.0,
    10.0,
    25,
)
QUICK = Sizes((1e-3, 1e-6), (1e-3,), (1, 8), 1, 1.0, 1.0, 2)

#: Runs that take longer are not repeated.
FAST_S = 0.7


def measure(quick: bool = False, names: tuple[str, ...] = ()) -> dict[str, Any]:
    """Measure all of it; the keys are in the module's docstring.

    Raises
    ------
    ValueError
        For a scene that there is not.
    """
    sizes = QUICK if quick else FULL
    folder = shared_folder() / 'config' / 'scenes'
    shipped = tuple(sorted(path.stem for path in folder.glob('*.yaml')))
    paths = [find_scene(name) for name in names or shipped]
    result: dict[str, Any] = {
        'precision': [precision(path, sizes) for path in paths],
        'costs': [costs(path, sizes) for path in paths],
        'pace': pace(find_scene(PLATE), sizes),
    }
    ratios = [entry['front']['ratio'] for entry in result['precision'] if entry.get('front')]
    plate = [entry['speed'] for entry in result['costs'] if entry['scene'] == PLATE]
    shares = [
        part['share']
        for entry in result['costs']
        for part in entry['without'].values()
        if part['share'] is not None
    ]
    values = {
        'front.ratio': max(ratios, default=None),
        'plate.speed': plate[0] if plate else None,
        'pace.slowest_share': result['pace']['slowest_share'],
        'costs.largest_share': max(shares, default=None),
    }
    result['wanted'] = verdicts(WANTED, values)
    return result


def fresh(description: dict[str, Any], **more: Any) -> Scene:
    """Build a scene; all are of one trial."""
    return Scene({**description, **more}, np.random.default_rng(0))


def precision(path: Path, sizes: Sizes) -> dict[str, Any]:
    """Measure the errors and run times of all methods on one scene."""
    description = read_yaml(path)
    scene = fresh(description)
    ode = Ode(scene)
    entry: dict[str, Any] = {
        'scene': path.stem, 'simulated_s': scene.duration_s, 'states': ode.size, 'note': '',
        'range_v': None, 'reference': None, 'runs': [], 'shipped_live': None, 'front': None,
    }  # fmt: skip
    if not ode.size:
        entry['note'] = 'no friction and no low-pass: its volts are a closed form of the time'
        return entry
    (method, rtol, reference), (check_method, _, check) = _references(ode)
    errors = Errors(reference, ode)
    entry['range_v'] = errors.range_v
    entry['reference'] = {
        'method': method,
        'check': check_method,
        'rtol': rtol,
        **errors.of(check.clean_v, check.position_m, check.onset_s),
    }
    for n in sizes.steps_per_sample:
        entry['runs'].append(_live(description, n, errors, ode, sizes))
    shipped = _live(description, scene.plan.steps_per_sample, errors, ode, sizes)
    entry['shipped_live'] = shipped
    for name in ('LSODA', 'BDF', 'Radau', *EXPLICIT):
        tolerances = sizes.explicit_tolerances if name in EXPLICIT else sizes.tolerances
        gave_up = name in EXPLICIT
        for rtol in tolerances:
            run = None if gave_up else _rival(ode, name, rtol, errors, sizes, None)
            if run is None or run['said']:
                gave_up = True
                run = _rival(ode, name, rtol, errors, sizes, _stretch(ode))
            entry['runs'].append(run)
    if entry['reference']['voltage_error'] < FRONT_ERROR:
        entry['front'] = front(entry['runs'])
    else:
        entry['note'] = 'the two references differ by more than the errors to be compared'
    return entry


def _references(ode: Ode) -> list[tuple[str, float, Solution]]:
    """Return two solutions of the tightest tolerances by two methods."""
    found = []
    for method, rtol in REFERENCES:
        try:
            found.append((method, rtol, solve(ode, method, rtol, budget_s=120.0)))
        except RuntimeError:  # The next one may do it.
            continue
        if len(found) == 2:
            return found
    raise RuntimeError('no two methods agree on a reference: all others failed')


def _stretch(ode: Ode) -> tuple[int, int]:
    """Return the first and last sample of the stretch about the start of the motion."""
    rate_hz = ode.scene.true_rate_hz
    start_s = ode.moving_s()
    if not math.isfinite(start_s):
        start_s = 0.5 * ode.scene.duration_s
    if ode.with_object:
        # What pulls at it is the last thing before the grip opens.
        load = LoadNumbers(*ode.drive.load)
        pulled = np.flatnonzero(np.diff(load.force_n) != 0.0)
        start_s = float(load.corners_s[pulled[1]]) if len(pulled) > 1 else start_s
    first = max(round((start_s - STRETCH_S[0]) * rate_hz), 0)
    return first, min(round((start_s + STRETCH_S[1]) * rate_hz), ode.scene.length - 1)


class Errors:
    """Errors against a reference.

    Parameters
    ----------
    reference
        The solution to hold against.
    ode
        Whose it is.
    """

    def __init__(self, reference: Solution, ode: Ode) -> None:
        self.reference, self.ode = reference, ode
        self.range_v = float(np.ptp(reference.clean_v))

    def of(
        self, clean_v: Floats, position_m: Floats, onset_s: Floats, first: int = 0
    ) -> dict[str, float | None]:
        """Return the errors; those of a stretch from its ``first`` sample on."""
        reference = self.reference
        n = min(len(clean_v), len(reference.clean_v) - first)
        rows = slice(first, first + n)
        voltage = float(np.abs(clean_v[:n] - reference.clean_v[rows]).max()) / self.range_v
        onset_error_s = np.abs(onset_s - reference.onset_s)
        # An onset that only one of the two has is an error without a size, but for stretches.
        some = np.isfinite(onset_error_s)
        onset = float(onset_error_s[some].max()) if some.any() else None
        way = position = relative = None
        if self.ode.with_object:
            way = float(np.ptp(reference.position_m))
            position = float(np.abs(position_m[:n] - reference.position_m[rows]).max())
            relative = position / way if way else None
        return {
            'voltage_error': voltage,
            'onset_error_s': onset,
            'position_error_m': position,
            'position_error': relative,
        }


def _live(
    description: dict[str, Any], steps_per_sample: int, errors: Errors, ode: Ode, sizes: Sizes
) -> dict[str, Any]:
    """Run the live stepper."""
    rate_hz = ode.scene.true_rate_hz
    step_s = (1.0 + 1e-6) / (rate_hz * steps_per_sample)
    n = len(errors.reference.time_s)
    least_s = math.inf
    for _ in range(sizes.rounds + 1):
        scene = fresh(description, step_s=step_s)
        with gc_off():
            start_s = time.thread_time()
            _, clean_v, position_m, _ = scene.clean(n)
            least_s = min(least_s, time.thread_time() - start_s)
    sheared = fresh(shows_shears(description, scene))
    onset_s = live_onset_s(sheared, ode)
    return {
        'method': 'live',
        'setting': f'{scene.plan.steps_per_sample} steps a sample',
        'over': [0.0, float(errors.reference.time_s[-1])],
        **errors.of(clean_v, position_m, onset_s),
        'run_time_per_s': least_s * rate_hz / n,
        'steps': scene.plan.steps_per_sample * (n - 1),
        'said': '',
    }


def _rival(
    ode: Ode,
    method: str,
    rtol: float,
    errors: Errors,
    sizes: Sizes,
    stretch: tuple[int, int] | None,
) -> dict[str, Any]:
    """Run one of SciPy's methods; the line that it says where it cannot."""
    reference = errors.reference
    first, last = stretch or (0, len(reference.time_s) - 1)
    start = reference.states[first] if stretch else None
    time_s = reference.time_s
    run: dict[str, Any] = {
        'method': method, 'setting': f'rtol {rtol:g}',
        'over': [float(time_s[first]), float(time_s[last])], 'voltage_error': None,
        'onset_error_s': None, 'position_error_m': None, 'position_error': None,
        'run_time_per_s': None, 'steps': None, 'said': '',
    }  # fmt: skip
    least_s = math.inf
    try:
        for _ in range(sizes.rounds):
            with gc_off():
                budget_s = sizes.stretch_budget_s if stretch else sizes.budget_s
                solution = solve(ode, method, rtol, stretch, start, budget_s)
            least_s = min(least_s, solution.run_time_s)
            if solution.run_time_s > FAST_S:
                break
    except (GivenUpError, ValueError, RuntimeError) as error:
        return run | {'said': str(error)}
    simulated_s = solution.time_s[-1] - solution.time_s[0]
    return (
        run
        | errors.of(solution.clean_v, solution.position_m, solution.onset_s, first)
        | {'run_time_per_s': least_s / simulated_s, 'steps': solution.steps}
    )


def front(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Hold the live stepper against the others' front at errors of 1e-3 and above.

    The time that a method takes for an error is that of its fastest run which errs no more, and
    between two runs the straight line in logarithms. A rival's runs count where they err by 1e-3
    and more, and its line at 1e-3.
    """
    live = _envelope([run for run in runs if run['method'] == 'live'])
    worst: dict[str, Any] = {'ratio': None, 'against': ''}
    for method in dict.fromkeys(run['method'] for run in runs if run['method'] != 'live'):
        rival = _envelope([run for run in runs if run['method'] == method and not run['said']])
        if not len(rival):
            continue
        at = sorted({FRONT_ERROR, *(e for e in rival[:, 0] if e > FRONT_ERROR)})
        for error in at:
            theirs, ours = _time_at(error, rival), _time_at(error, live)
            if theirs is None:
                continue
            ratio = math.inf if ours is None else ours / theirs
            if worst['ratio'] is None or ratio > worst['ratio']:
                worst = {'ratio': ratio, 'against': f'{method} at {error:.1e}'}
    return worst


def _envelope(runs: list[dict[str, Any]]) -> Floats:
    """Return errors, falling, and run times, rising, of the runs that no other beats in both."""
    points = sorted(
        (run['run_time_per_s'], run['voltage_error']) for run in runs if not run['said']
    )
    kept: list[tuple[float, float]] = []
    for run_time, error in points:
        if not kept or error < kept[-1][0]:
            kept.append((max(error, 1e-16), run_time))
    return np.array(kept).reshape(-1, 2)


def _time_at(error: float, envelope: Floats) -> float | None:
    """Return the run time for an error; None where it is too small."""
    errors, times = envelope[::-1].T  # errors rise
    if error < errors[0]:
        return None
    return float(np.exp(np.interp(np.log(error), np.log(errors), np.log(times))))


def costs(path: Path, sizes: Sizes) -> dict[str, Any]:
    """Measure the run time of one scene, and of the same without each of its parts."""
    description = read_yaml(path)
    scene = fresh(description)
    parts = [name for name in description if name in PARTS]
    without: dict[str, dict[str, Any]] = {}
    sides: dict[str, dict[str, Any]] = {'': description}
    for part in (name for name in parts if name not in ALWAYS):
        left = {name: content for name, content in description.items() if name != part}
        without[part] = {'share': None, 'said': ''}
        try:
            fresh(left)
        except ValueError as error:
            without[part]['said'] = str(error)
        else:
            sides[part] = left

    # The sides take turns piece by piece, and of each piece the least time counts: what else
    # the machine does differs from moment to moment.
    pieces = range(0, scene.length, PIECE_ROWS)
    least_s = np.full((len(sides), len(pieces)), math.inf)
    for _ in range(sizes.cost_rounds):
        ready = [fresh(content) for content in sides.values()]
        with gc_off():
            for piece in range(len(pieces)):
                for i, side in enumerate(ready):
                    start_s = time.thread_time()
                    side.read(PIECE_ROWS)
                    taken_s = time.thread_time() - start_s
                    least_s[i, piece] = min(least_s[i, piece], taken_s)
    times_s = least_s.sum(axis=1).tolist()
    for part, time_s in zip(sides, times_s, strict=True):
        if part:
            without[part]['share'] = time_s / times_s[0]
    return {
        'scene': path.stem,
        'parts': parts,
        'run_time_per_s': times_s[0] / scene.duration_s,
        'speed': scene.duration_s / times_s[0],
        'without': without,
    }


def pace(path: Path, sizes: Sizes) -> dict[str, Any]:
    """Measure how long reads of a few rows take, as a share of the time that these last."""
    least: Floats | None = None
    for _ in range(sizes.rounds):
        scene = fresh(read_yaml(path))
        taken = []
        with gc_off():
            while True:
                start_s = time.perf_counter()
                n = len(scene.read(PACE_ROWS).volts)
                if n < PACE_ROWS:
                    break
                taken.append(time.perf_counter() - start_s)
        # What else the machine did is in one round and not in the others.
        least = np.array(taken) if least is None else np.minimum(least, taken)
    lasts_s = PACE_ROWS / scene.sample_rate_hz
    assert least is not None
    return {
        'rows': PACE_ROWS,
        'slowest_share': float(least.max()) / lasts_s,
        'mean_share': float(least.mean()) / lasts_s,
    }


def _figure(value: float | None, unit: float = 1.0) -> str:
    return '-' if value is None else f'{value / unit:.1e}'


def table(result: dict[str, Any]) -> str:
    """Return what :func:`measure` gave as text, at most 99 columns wide."""
    lines = ['Run time for a simulated second; what share of it is left without a part']
    for entry in result['costs']:
        left = ', '.join(
            f'{part} {"needed" if figures["said"] else format(figures["share"], ".0%")}'
            for part, figures in entry['without'].items()
        )
        lines.append(
            f'{entry["scene"]:<13}{entry["run_time_per_s"] * 1e3:6.2f} ms'
            f'{entry["speed"]:5.0f} x real time  without {left}'
        )
    figures = result['pace']
    lines += [
        '',
        f'Slowest read of {figures["rows"]} rows of {PLATE}: {figures["slowest_share"]:.1%} of '
        f'the time they last; mean {figures["mean_share"]:.1%}',
    ]
    for entry in result['precision']:
        lines += ['', f'{entry["scene"]}: {entry["simulated_s"]:g} s, {entry["states"]} states']
        if not entry['runs']:
            lines.append(f'  {entry["note"]}')
            continue
        reference = entry['reference']
        lines.append(
            f'  reference {reference["method"]} at rtol {reference["rtol"]:g}; '
            f'{reference["check"]} differs by {_figure(reference["voltage_error"])} of the range, '
            f'{_figure(reference["onset_error_s"], 1e-3)} ms, '
            f'{_figure(reference["position_error_m"])} m'
        )
        lines.append(
            f'  {"method":<8}{"setting":<20}{"from to s":<14}{"volts":>9}{"onset ms":>10}'
            f'{"object m":>10}{"ms per s":>11}'
        )
        for run in entry['runs']:
            over = f'{run["over"][0]:.2f} {run["over"][1]:.2f}'
            start = f'  {run["method"]:<8}{run["setting"]:<20}{over:<14}'
            if run['said']:
                lines.append(start + run['said'][: 99 - len(start)])
                continue
            # What is below the reference's own error is not known.
            known = run['voltage_error'] >= reference['voltage_error']
            volts = ('' if known else '<') + _figure(
                run['voltage_error'] if known else reference['voltage_error']
            )
            lines.append(
                f'{start}{volts:>9}{_figure(run["onset_error_s"], 1e-3):>10}'
                f'{_figure(run["position_error_m"]):>10}{run["run_time_per_s"] * 1e3:>11.2f}'
            )
        worst = entry['front']
        shipped = entry['shipped_live']
        lines.append(
            f'  as shipped ({shipped["setting"]}): {_figure(shipped["voltage_error"])} of the '
            f'range, {shipped["run_time_per_s"] * 1e3:.2f} ms per s'
        )
        if worst is None:
            lines.append(f'  {entry["note"]}')
        elif worst['ratio'] is not None:
            lines.append(
                f'  live over the best of the others at the same error, 1e-3 and above: '
                f'{worst["ratio"]:.2f} ({worst["against"]})'
            )
    lines += ['', 'Wanted']
    for claim, verdict in result['wanted'].items():
        value = '-' if verdict['value'] is None else f'{verdict["value"]:.3g}'
        met = {None: 'not measured', True: 'met', False: 'NOT MET'}[verdict['met']]
        lines.append(f'  {claim:<22}{value:>9}  {verdict["bound"]:<8} {met}')
    return '\n'.join(lines)
