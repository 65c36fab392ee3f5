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
    lines = [f'{figures["fingers"]} fingers of 16 channels at 380 Hz, in turns']
    for who, title in WHO.items():
        lines += ['', f'{who:<12} {title}']
        for name, value in figures[who].items():
            shares = value.items() if isinstance(value, dict) else [('', value)]
            words = ', '.join(f'{node} {number:.3g}'.strip() for node, number in shares)
            verdict = figures['wanted'].get(f'{who}.{name}')
            claim = f'  {claim_in_words(verdict)}' if verdict else ''
            lines.append(f'  {name:<28} {words}{claim}')
    return '\n'.join(lines)
