"""Error against run time of the scenes, for the live stepper and SciPy's integrators.

The reference of each scene is a tight-tolerance implicit solution, checked by a second method.
Voltage errors are the worst over samples and channels, as a share of the range of the
reference's volts (clean: without baselines, noise and faults); an onset is when the surface has
passed 10 um further over a taxel than at the start of the motion; the object's position is that
until it is lost. Run times are of the processor, on one core, without compiling, with all that
makes the volts of the samples; those of SciPy's methods with the equations, their Jacobian and
their drive compiled, and tolerances in shares of each state's own scale.

A method that cannot do the whole scene within its budget does a stretch of it about the start of
the motion, from the state of the reference there; explicit methods do only that, as the stiff
bristles limit their steps everywhere.

:func:`measure_scenes` gives one object (keys of ``python -m benchmarks scenes --json``):

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

from collections.abc import Sequence
from typing import Any

from benchmarks.scenes.costs import read_pace, scene_costs
from benchmarks.scenes.precision import scene_precision
from benchmarks.scenes.sizes import FULL, QUICK
from benchmarks.verdicts import verdicts
from slip_detector.evaluation.bounds import Bound
from slip_detector.parameters.shared_folder import shared_folder
from slip_detector.scenes import find_scene

WANTED = {
    'front.ratio': Bound(high=1.0),
    'plate.speed': Bound(low=50.0),
    'pace.slowest_share': Bound(high=1.0, strict=True),
    'costs.largest_share': Bound(high=1.0, strict=True),
}

#: The scene for which speed and pace are wanted.
PLATE = 'plate_400um'


def measure_scenes(quick: bool = False, names: Sequence[str] = ()) -> dict[str, Any]:
    """Measure errors, run times and costs; the keys are in the module's docstring.

    Parameters
    ----------
    quick
        Few settings, each once; nothing is judged.
    names
        Scenes to measure; none: all that come with the package.

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
        'precision': [scene_precision(path, sizes) for path in paths],
        'costs': [scene_costs(path, sizes) for path in paths],
        'pace': read_pace(find_scene(PLATE), sizes),
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
    result['wanted'] = verdicts(WANTED, values, judged=not quick)
    return result
