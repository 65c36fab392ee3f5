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

"""The subcommand ``scenes``."""

import argparse

from benchmarks.measurement import Measurement, heading, machine, shared_options
from benchmarks.pictures import draw_scenes_precision
from benchmarks.scenes.measure import measure_scenes
from benchmarks.scenes.table import scenes_table
from slip_detector.parameters.files import check_writable


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'scenes',
        "Measure errors and run times of the live stepper and of SciPy's integrators on the "
        'shipped scenes against a tight reference, and the run time of each part of a scene. '
        'Prints what is wanted and whether it is met; the exit code is 0 either way.',
        picture='out/scenes_work_precision.png',
    )
    parser.add_argument(
        '--scene',
        action='append',
        default=[],
        metavar='NAME',
        help='measure only this scene; repeatable',
    )
    return parser


def run(words: argparse.Namespace) -> Measurement:
    """Measure the scenes."""
    # A picture that cannot be written is reported before the measurement, not after it.
    picture = words.plot
    if picture:
        check_writable(picture)
    figures = {'machine': machine(), 'quick': words.quick}
    figures |= measure_scenes(words.quick, words.scene)
    if picture:
        draw_scenes_precision(picture, figures)
    return Measurement(figures, '\n\n'.join((heading(figures), scenes_table(figures))))
