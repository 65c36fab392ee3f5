"""A hand left to itself for ``slip_benchmark soak``: losses, memory, latency, processor time.

Keys of the result:

``soak``
    ``seconds`` measured after the warm-up, ``fingers``, ``samples``, ``lost`` (by kind) and
    ``lost_total``, ``latency_median_ms``, ``latency_p99_ms`` (first and second half: the median
    of the 99th percentiles of each second), ``latency_p99_growth`` (their ratio),
    ``memory_growth_percent`` (of the process that grew most), ``memory_mib`` and ``cpu_percent``
    by role, ``cpu_percent_total``.
``wanted``
    By claim: ``value``, ``bound``, ``met``.
"""

import json
import os
import subprocess
import sys
from typing import Any

from benchmarks.chain_speed import end_session, last_line, why_not_ros
from benchmarks.command import Bound, verdicts

#: What is wanted of each figure.
WANTED = {
    'lost_total': Bound('<=', 0),
    'latency_p99_growth': Bound('<=', 1.25),
    'memory_growth_percent': Bound('<=', 2.0),
    'cpu_percent_total': Bound('<=', 100.0),
}

SECONDS, QUICK_SECONDS = 660.0, 15.0

#: Start, end and a machine that is busy.
EXTRA_S = 300.0


def measure(seconds: float, fingers: int, samples_per_message: int) -> dict[str, Any]:
    """Let the fingers run and return the figures.

    Raises
    ------
    RuntimeError
        When the nodes cannot run here, or fail.
    """
    reason = why_not_ros()
    if reason:
        raise RuntimeError(f'the soak needs the nodes: {reason}')
    command = [sys.executable, '-m', 'benchmarks.soak_nodes', '--seconds', str(seconds)]
    command += ['--fingers', str(fingers), '--samples-per-message', str(samples_per_message)]
    environment = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'} | dict(os.environ)
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
        start_new_session=True,
    )  # fmt: skip
    try:
        output, errors = process.communicate(timeout=seconds + EXTRA_S)
    except subprocess.TimeoutExpired:
        raise RuntimeError('the soak did not end in time') from None
    finally:
        end_session(process)
    if process.returncode:
        raise RuntimeError(f'the soak failed: {last_line(errors)}')
    figures: dict[str, Any] = json.loads(output)
    return {'soak': figures, 'wanted': verdicts(WANTED, {name: figures[name] for name in WANTED})}


def table(result: dict[str, Any]) -> str:
    """Lay the figures out as text, the wanted bound beside each claim."""
    part = result['soak']

    def claim(name: str) -> str:
        entry = result['wanted'][name]
        return f'(wanted {entry["bound"]}: {"met" if entry["met"] else "NOT met"})'

    kinds = ', '.join(f'{count} {kind}' for kind, count in part['lost'].items() if count)
    first_ms, second_ms = part['latency_p99_ms']
    cpu, memory = part['cpu_percent'], part['memory_mib']
    return '\n'.join(
        (
            f'Soak         {part["fingers"]} fingers, {part["samples"]:,} samples, '
            f'{part["seconds"]:.0f} s after the warm-up',
            f'  lost                 {part["lost_total"]}  {claim("lost_total")}'
            + (f'  ({kinds})' if kinds else ''),
            f'  sample to decision   median {part["latency_median_ms"]:.2f} ms, p99 '
            f'{first_ms:.2f} ms in the first half, {second_ms:.2f} ms in the second  '
            f'{claim("latency_p99_growth")}',
            f'  memory               grew by {part["memory_growth_percent"]:.2f} % at most  '
            f'{claim("memory_growth_percent")}; the detectors {memory["slip_detector"]:.0f} MiB, '
            f'the drivers {memory["slip_driver"]:.0f} MiB',
            f'  share of a core      {part["cpu_percent_total"]:.0f} %  '
            f'{claim("cpu_percent_total")}: detectors {cpu["slip_detector"]:.0f} %, drivers '
            f'{cpu["slip_driver"]:.0f} %',
        )
    )
