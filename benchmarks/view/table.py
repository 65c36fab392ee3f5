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

"""The figures of the live page as text."""

from typing import Any

from benchmarks.verdicts import claim_in_words

#: Titles of the kinds of turns.
WHO = {
    'closed': 'no page open',
    'elsewhere': 'a program takes the frames, as a browser on another machine would',
    'here': 'Chromium draws them on this machine',
}


def view_table(figures: dict[str, Any]) -> str:
    """Return the figures of :func:`benchmarks.view.measure.measure_view` as text."""
    return '\n\n'.join(
        [f'{figures["fingers"]} fingers of 16 channels at 380 Hz, in turns']
        + ['\n'.join(_lines(who, figures)) for who in WHO]
    )


def _lines(who: str, figures: dict[str, Any]) -> list[str]:
    part, wanted = figures[who], figures['wanted']

    def claim(figure: str) -> str:
        verdict = wanted.get(f'{who}.{figure}')
        return f'  {claim_in_words(verdict)}' if verdict else ''

    cpu = part['cpu_percent']
    lines = [f'{who:<12} {WHO[who]}, {part["seconds"]:.0f} s']
    if who != 'closed':
        lines.append(
            f'  frames a second      {part["frames_a_second"]:.1f}{claim("frames_a_second")}; '
            f'{part["frames_in_the_worst_second"]:.0f} in the worst second'
        )
    lines.append(
        f'  share of a core      slip_view {cpu["slip_view"]:.1f} %'
        f'{claim("slip_view_cpu_percent")}; detectors {cpu["slip_detector"]:.1f} %, drivers '
        f'{cpu["slip_driver"]:.1f} %'
        + (f', Chromium {part["browser_cpu_percent"]:.0f} %' if who == 'here' else '')
    )
    if who == 'here':
        lines += [
            f'  memory               slip_view {part["memory_mib"]:.0f} MiB, grew by '
            f'{part["memory_growth_percent"]:.2f} %{claim("memory_growth_percent")}',
            f'                       the page {part["heap_mib"]:.1f} MiB, grew by '
            f'{part["heap_growth_percent"]:.2f} %{claim("heap_growth_percent")}',
        ]
    compared = (
        f'between turns a factor of {part["latency_noise"]:.2f}'
        if who == 'closed'
        else f'{part["latency_ratio"]:.2f} times{claim("latency_ratio")}'
    )
    lines.append(
        f'  sample to decision   median {part["latency_median_ms"]:.2f} ms, '
        f'p99 {part["latency_p99_ms"]:.2f} ms; {compared}'
    )
    return lines
