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

"""The subcommand ``extremes``."""

import argparse

from benchmarks.extremes.measure import measure_extremes
from benchmarks.extremes.table import extremes_table
from benchmarks.measurement import Measurement, machine, shared_options


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    return shared_options(
        'extremes',
        'Run the simulated fingertip in extreme cases: whether all results are finite and '
        'bounded, whether friction creates energy, the error against a tight reference, and what '
        'is refused with which message. --quick slides for a minute instead of an hour.',
    )


def run(words: argparse.Namespace) -> Measurement:
    """Measure the extremes."""
    figures = {'machine': machine(), 'quick': words.quick} | measure_extremes(words.quick)
    return Measurement(figures, extremes_table(figures))
