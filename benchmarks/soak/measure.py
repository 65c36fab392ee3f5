"""Drivers and detectors that run for long: losses, memory, latency, processor time.

:func:`measure_soak` gives one object (keys of ``python -m benchmarks soak --json``):

``soak``
    ``seconds`` measured after the warm-up, ``fingers``, ``samples``, ``lost`` (by kind) and
    ``lost_total``, ``latency_median_ms``, ``latency_p99_ms`` (first and second half: the median
    of the 99th percentiles of each second), ``latency_p99_growth`` (their ratio),
    ``memory_growth_percent`` (of the process that grew most), ``memory_mib`` and ``cpu_percent``
    by role, ``cpu_percent_total``.
``wanted``
    By claim: ``value``, ``bound``, ``met``.
"""

from typing import Any

from benchmarks.processes import figures_of_process, why_not_ros
from benchmarks.verdicts import verdicts
from slip_detector.evaluation.bounds import Bound

#: What is wanted of each figure.
WANTED = {
    'lost_total': Bound(high=0),
    'latency_p99_growth': Bound(high=1.25),
    'memory_growth_percent': Bound(high=2.0),
    'cpu_percent_total': Bound(high=100.0),
}

#: How long the nodes run, warm-up included.
SECONDS, QUICK_SECONDS = 660.0, 15.0

#: For the start and the end of the processes on a busy machine.
EXTRA_S = 420.0


def measure_soak(seconds: float, fingers: int, samples_per_message: int) -> dict[str, Any]:
    """Let the fingers run; the keys are in the module's docstring.

    Parameters
    ----------
    seconds
        How long, warm-up included.
    fingers
        So many drivers and so many detectors.
    samples_per_message
        Of the drivers.

    Raises
    ------
    RuntimeError
        When the nodes cannot run here, or fail.
    """
    reason = why_not_ros()
    if reason:
        raise RuntimeError(f'the soak needs the nodes: {reason}')
    words = ['--seconds', str(seconds), '--fingers', str(fingers)]
    words += ['--samples-per-message', str(samples_per_message)]
    figures = figures_of_process('benchmarks.soak.hand', words, seconds + EXTRA_S)
    return {'soak': figures, 'wanted': verdicts(WANTED, {name: figures[name] for name in WANTED})}
