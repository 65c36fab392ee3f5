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

"""Error against run time of the scenes, for the live stepper and SciPy's integrators.

The reference of each scene is an implicit method's solution with a tight tolerance, checked by a
second method.
Voltage errors are the worst over samples and channels, as a share of the range of the
reference's volts (clean: without baselines, noise and faults). An onset is when the surface has
passed 10 um further over a taxel than at the start of the motion. The object's position counts
until the object is lost. Run times are processor times on one core, without compilation, and
include all computation of the samples' volts. For SciPy's methods the equations, their
Jacobian and their drive are compiled, and the tolerances are relative to each state's own scale.

A method that cannot solve the whole scene within its budget solves a stretch of it about the start
of the motion, beginning with the state of the reference there. Explicit methods solve only this
stretch, because the stiff bristles limit their steps everywhere.

:func:`measure_scenes` gives one object (keys of ``python -m benchmarks scenes --json``):

``precision``
    One object for each scene: ``scene``, ``simulated_s``, ``states`` (of the differential
    equation), ``note`` (why there is nothing to compare, else empty), ``range_v``, ``reference``
    with ``method``, ``check``, ``rtol`` and the differences of the two: ``voltage_error``,
    ``onset_error_s``, ``position_error_m``; and ``runs``: ``method`` (``live`` is the live
    stepper), ``setting``, ``over`` (begin and end in seconds), ``voltage_error``,
    ``onset_error_s``, ``position_error_m``, ``position_error`` (relative to the distance that the
    object moves), ``run_time_per_s`` (for a simulated second), ``steps``, and ``said``: the
    message with which a method refused or gave up, with null for the figures. An error is null
    when the scene has no such quantity. ``shipped_live`` is the run of the live stepper with the
    step of the shipped scene. ``front`` has ``ratio``, the largest ratio of the live stepper's
    time to that of another method at the same error, for errors of 1e-3 and above, and
    ``against``, the run for which that was; it is null when the references differ by more.
``costs``
    One object for each scene: ``scene``, ``parts``, ``run_time_per_s`` of the whole scene, noise
    included, ``speed`` (times real time), and ``without``: for each part ``share``, the run time
    without the part as a share of that with it, or ``said``, the message with which the scene is
    refused without it.
``pace``
    For the plate: ``rows`` of a read, ``slowest_share``, the time of the slowest read as a share
    of the time that its rows span, and ``mean_share``.
``wanted``
    For each claim its measured ``value``, the ``bound`` as text and whether it is ``met``.
"""

from collections.abc import Sequence
from typing import Any

from benchmarks.scenes.costs import read_pace, scene_costs
from benchmarks.scenes.precision import scene_precision
from benchmarks.scenes.sizes import FULL, QUICK
from benchmarks.verdicts import verdicts
from slip_detector.evaluation.figures import Bound
from slip_detector.parameters.files import shared_folder
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
        Run few settings, each once, and judge nothing.
    names
        Scenes to measure; empty: all that come with the package.

    Raises
    ------
    ValueError
        For an unknown scene.
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
