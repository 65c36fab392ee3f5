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

"""The live page of five fingers at 380 Hz, and what it costs the detectors.

:func:`measure_view` gives one object (keys of ``python -m benchmarks view --json``):

``fingers``
    How many; each is a simulated fingertip of 16 channels, as ``hand.launch.py`` starts them.
``closed``, ``elsewhere``, ``here``
    Without a viewer; with a program that takes the frames and draws nothing, like a browser on
    another machine; with Chromium on this machine. They take turns. Each has ``seconds``,
    ``latency_median_ms`` and ``latency_p99_ms`` (age of the samples at their decision, as the
    detectors report it every second: the median over a turn, and of all turns), ``cpu_percent`` of
    a core by executable, and ``slip_view_cpu_percent``, which is one of these.

    The two with a viewer also have ``frames_a_second``, ``frames_in_the_worst_second`` and
    ``latency_ratio`` to that of ``closed``; ``closed`` has ``latency_noise``, the ratio of its
    largest to its smallest turn; ``here`` has ``browser_cpu_percent``, ``memory_mib`` of slip_view
    and ``memory_growth_percent``, ``heap_mib`` of the page after a garbage collection, and
    ``heap_growth_percent``, from the first tenth of the time to the last.
``wanted``
    For each claim, by ``part.figure``: the measured ``value``, the ``bound`` as text and whether
    it is ``met``, which is null where nothing is judged.
"""

from typing import Any

from benchmarks.processes import figures_of_process, why_not_ros
from benchmarks.tune.browser import why_no_browser
from benchmarks.verdicts import values_of, verdicts
from slip_detector.evaluation.figures import Bound

#: The wanted bounds; that of the latency is the noise of the same run.
WANTED = {
    'elsewhere.slip_view_cpu_percent': Bound(high=30.0),
    'here.slip_view_cpu_percent': Bound(high=30.0),
    'here.frames_a_second': Bound(low=29.0),
    'here.memory_growth_percent': Bound(high=2.0),
    'here.heap_growth_percent': Bound(high=5.0),
}

#: Time, in seconds, for which the page is open in the browser.
SECONDS, QUICK_SECONDS = 60.0, 8.0

#: Pairs of turns without a page and with one, and how long each turn is.
PAIRS, TURN_SECONDS = 5, 20.0
QUICK_PAIRS, QUICK_TURN_SECONDS = 2, 4.0

#: Time for these, and for all starts and ends, on a busy machine.
EXTRA_S = 900.0

#: slip_view shows all detectors of its domain. The tests have 1 to 100.
ENVIRONMENT = {'ROS_DOMAIN_ID': '101'}


def measure_view(quick: bool, seconds: float | None = None) -> dict[str, Any]:
    """Let nodes, page and browser run; the keys are in the module's docstring.

    Parameters
    ----------
    quick
        Measure for a short time, and judge nothing.
    seconds
        How long the page is open in the browser, instead of the usual time.

    Raises
    ------
    RuntimeError
        When nodes or browser cannot run here, or fail.
    """
    for reason in (why_not_ros(), why_no_browser()):
        if reason:
            raise RuntimeError(f'the live page cannot be measured: {reason}')
    lasts_s = seconds or (QUICK_SECONDS if quick else SECONDS)
    pairs, turn_s = (QUICK_PAIRS, QUICK_TURN_SECONDS) if quick else (PAIRS, TURN_SECONDS)
    words = ['--seconds', str(lasts_s), '--pairs', str(pairs), '--turn-seconds', str(turn_s)]
    figures = figures_of_process(
        'benchmarks.view.session', words, lasts_s + EXTRA_S, environment=ENVIRONMENT
    )
    noise = Bound(high=figures['closed']['latency_noise'])
    wanted = {**WANTED, 'elsewhere.latency_ratio': noise}
    return {**figures, 'wanted': verdicts(wanted, values_of(wanted, figures), judged=not quick)}
