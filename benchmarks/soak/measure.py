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

"""Drivers and detectors that run for long: losses, memory, latency, processor time.

:func:`measure_soak` gives one object (keys of ``python -m benchmarks soak --json``):

``relay``
    Detector node against a bare relay node: ``rate_hz``, ``samples``, ``changes``, ``detector``
    and ``relay`` with ``median_ms``, ``p99_ms``, ``cpu_percent`` and ``lost``, then
    ``latency_ratio`` (of the medians) and ``cpu_ratio``; :mod:`benchmarks.soak.end_to_end` tells
    how they are measured and why.
``finger``, ``hand``, ``fast_hand``, ``fast_finger``
    A driver and a detector for one or five fingers of 16 channels; ``finger`` and ``hand`` play
    the simulated fingertip at 380 Hz, ``fast_hand`` a recording at 1 kHz, ``fast_finger`` one at 5
    kHz in messages of ten samples. The figures are ``seconds`` measured after the warm-up,
    ``fingers``, ``sample_rate_hz``, ``samples_per_message``, ``samples``, ``lost`` (by kind) and
    ``lost_total``, ``latency_median_ms``, ``latency_p99_ms`` (of the first and of the second half:
    the median of the 99th percentiles of all seconds) and ``latency_p99_growth``, their ratio,
    ``memory_growth_percent`` (of the process that grew most), ``memory_mib`` and ``cpu_percent``
    by executable, and ``cpu_percent_total``.
``wanted``
    For each claim, by ``part.figure``: the measured ``value``, the ``bound`` as text and whether
    it is ``met``; both are null where the part was not measured, and ``met`` where nothing is
    judged.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from benchmarks.processes import figures_of_process, why_not_ros
from benchmarks.verdicts import values_of, verdicts
from slip_detector.evaluation.figures import Bound

#: The bounds that are wanted, by part and figure.
WANTED = {
    'relay.latency_ratio': Bound(high=1.2),
    'relay.cpu_ratio': Bound(high=0.6),
    'finger.lost_total': Bound(high=0),
    'finger.latency_p99_growth': Bound(high=1.25),
    'finger.memory_growth_percent': Bound(high=2.0),
    'finger.cpu_percent_total': Bound(high=100.0),
    'hand.lost_total': Bound(high=0),
    'hand.cpu_percent_total': Bound(high=50.0),
    'fast_hand.lost_total': Bound(high=0),
    'fast_finger.lost_total': Bound(high=0),
    'fast_finger.cpu_percent_total': Bound(high=30.0),
}


class Part(NamedTuple):
    """A part of the soak.

    Attributes
    ----------
    module : str
        Module that runs as a process.
    words : tuple of str
        Arguments of the process.
    seconds, quick_seconds : float
        How long the nodes run, warm-up included.
    """

    module: str
    words: tuple[str, ...]
    seconds: float
    quick_seconds: float


def _hand(fingers: int, sample_rate_hz: float, samples_per_message: int, seconds: float) -> Part:
    words = ['--fingers', str(fingers), '--sample-rate-hz', str(sample_rate_hz)]
    words += ['--samples-per-message', str(samples_per_message)]
    return Part('benchmarks.soak.hand', tuple(words), seconds, 15.0)


PARTS = {
    'relay': Part('benchmarks.soak.end_to_end', (), 25.0, 4.0),
    'finger': _hand(1, 380.0, 1, 660.0),
    'hand': _hand(5, 380.0, 1, 60.0),
    'fast_hand': _hand(5, 1000.0, 1, 60.0),
    'fast_finger': _hand(1, 5000.0, 10, 60.0),
}

#: Time for the start and the end of the processes on a busy machine.
EXTRA_S = 420.0


def measure_soak(
    parts: Sequence[str], quick: bool, seconds: float | None = None
) -> dict[str, Any]:
    """Let the nodes run; the keys are in the module's docstring.

    Parameters
    ----------
    parts
        Keys of ``PARTS``.
    quick
        Run each part for its ``quick_seconds``, and judge nothing.
    seconds
        How long each part runs, instead of its own time.

    Raises
    ------
    RuntimeError
        When the nodes cannot run here, or fail.
    """
    reason = why_not_ros()
    if reason:
        raise RuntimeError(f'the soak needs the nodes: {reason}')
    figures: dict[str, Any] = {}
    for name in parts:
        part = PARTS[name]
        lasts_s = seconds or (part.quick_seconds if quick else part.seconds)
        words = ['--seconds', str(lasts_s), *part.words]
        figures[name] = figures_of_process(part.module, words, lasts_s + EXTRA_S)
    verdicts_of_all = verdicts(WANTED, values_of(WANTED, figures), judged=not quick)
    return {**figures, 'wanted': verdicts_of_all}
