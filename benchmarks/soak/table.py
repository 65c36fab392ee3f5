"""The figures of the soak as text."""

from typing import Any

from benchmarks.verdicts import claim_in_words


def soak_table(figures: dict[str, Any]) -> str:
    """Return the figures of :func:`benchmarks.soak.measure.measure_soak` as text."""
    part = figures['soak']

    def claim(name: str) -> str:
        return claim_in_words(figures['wanted'][name])

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
