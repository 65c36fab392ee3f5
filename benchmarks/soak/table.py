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

"""The figures of the soak as text."""

from typing import Any

from benchmarks.verdicts import claim_in_words


def soak_table(figures: dict[str, Any]) -> str:
    """Return the figures of :func:`benchmarks.soak.measure.measure_soak` as text."""
    wanted = figures['wanted']
    parts = [name for name in figures if name in {claim.split('.')[0] for claim in wanted}]
    return '\n\n'.join(
        (_relay_lines if name == 'relay' else _hand_lines)(
            name, figures[name], _claims_of(name, wanted)
        )
        for name in parts
    )


def _claims_of(part: str, wanted: dict[str, Any]) -> dict[str, str]:
    """Return the claims about the figures of a part, in words, after two spaces."""
    claims = {}
    for claim, verdict in wanted.items():
        name, _, figure = claim.partition('.')
        if name == part:
            claims[figure] = f'  {claim_in_words(verdict)}'
    return claims


def _relay_lines(name: str, part: dict[str, Any], claims: dict[str, str]) -> str:
    lines = [
        f'{name:<12} {part["samples"]:,} samples at {part["rate_hz"]:g} Hz to the detector and to '
        f'a bare relay in turn; {part["changes"]:,} changes of slip'
    ]
    for node in ('detector', 'relay'):
        of_node = part[node]
        lines.append(
            f'  {node:<20} latency median {of_node["median_ms"]:.3f} ms, '
            f'p99 {of_node["p99_ms"]:.3f} ms; '
            f'{of_node["cpu_percent"]:.1f} % of a core; {of_node["lost"]} changes lost'
        )
    return '\n'.join(
        (
            *lines,
            f'  ratio of the medians {part["latency_ratio"]:.2f}{claims["latency_ratio"]}',
            f'  of processor times   {part["cpu_ratio"]:.2f}{claims["cpu_ratio"]}',
        )
    )


def _hand_lines(name: str, part: dict[str, Any], claims: dict[str, str]) -> str:
    def claim(figure: str) -> str:
        return claims.get(figure, '')

    kinds = ', '.join(f'{count} {kind}' for kind, count in part['lost'].items() if count)
    first_ms, second_ms = part['latency_p99_ms']
    cpu, memory = part['cpu_percent'], part['memory_mib']
    fingers = f'{part["fingers"]} fingers' if part['fingers'] > 1 else 'one finger'
    batches = ''
    if part['samples_per_message'] > 1:
        batches = f' in messages of {part["samples_per_message"]}'
    return '\n'.join(
        (
            f'{name:<12} {fingers} at {part["sample_rate_hz"]:g} Hz{batches}, '
            f'{part["samples"]:,} samples, {part["seconds"]:.0f} s after the warm-up',
            f'  lost                 {part["lost_total"]}{claim("lost_total")}'
            + (f'  ({kinds})' if kinds else ''),
            f'  sample to decision   median {part["latency_median_ms"]:.2f} ms, p99 '
            f'{first_ms:.2f} ms in the first half, {second_ms:.2f} ms in the second'
            f'{claim("latency_p99_growth")}',
            f'  memory               grew by {part["memory_growth_percent"]:.2f} % at most'
            f'{claim("memory_growth_percent")}; the detectors {memory["slip_detector"]:.0f} MiB, '
            f'the drivers {memory["slip_driver"]:.0f} MiB',
            f'  share of a core      {part["cpu_percent_total"]:.0f} %'
            f'{claim("cpu_percent_total")}: detectors {cpu["slip_detector"]:.0f} %, drivers '
            f'{cpu["slip_driver"]:.0f} %',
        )
    )
