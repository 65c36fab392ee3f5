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

"""The figures of the chain's speed as text."""

from collections.abc import Callable
from typing import Any

from benchmarks.chain.speed import CHANNEL_COUNTS
from benchmarks.verdicts import claim_in_words


def chain_speed_table(figures: dict[str, Any]) -> str:
    """Return the figures of :func:`~benchmarks.chain.speed.measure_chain_speed` as text."""

    def claim(name: str) -> str:
        return claim_in_words(figures['wanted'][name])

    lines = _block_lines(figures['blocks'], claim)
    part = figures['one_row']
    peaks = ', '.join(f'{peak} at {n} channels' for n, peak in part['peak_bytes_per_call'].items())
    lines += [
        '',
        f'One row a call  {part["channels"]} channels, {part["calls"]} calls, '
        f'least of {part["rounds"]} rounds',
        f'  SlipChain.update           {part["chain_us_per_call"]:10.2f} us a call',
        f'  one bare sosfilt           {part["sosfilt_us_per_call"]:10.2f} us a call',
        f'  speed-up                   {part["speedup"]:10.2f} times  {claim("one_row.speedup")}',
        '  memory beyond the arrays of the result:',
        f'    kept                     {part["kept_bytes_per_call"]:10.2f} bytes a call  '
        f'{claim("one_row.kept_bytes_per_call")}',
        f'    temporary arrays         {part["temporary_bytes_per_channel"]:10.2f} bytes a channel'
        f'  {claim("one_row.temporary_bytes_per_channel")}',
        f'    peak of a call, headers and Python objects: bytes {peaks}',
    ]
    part = figures['channels']
    lines += [
        '',
        f'Channels     {part["channel_samples"]:,} channel-samples a call, '
        f'least of {part["rounds"]} rounds',
    ]
    lines += [
        f'  {int(n):6,} channels            {ns:10.2f} ns a channel-sample, '
        f'{part["ratio"][n]:.2f} times that of {CHANNEL_COUNTS[0]}'
        for n, ns in part['ns_per_channel_sample'].items()
    ]
    lines.append(
        f'  worst ratio                {part["worst_ratio"]:10.2f} times  '
        f'{claim("channels.worst_ratio")}'
    )
    lines.append(
        f'  ratio of the most channels {part["last_ratio"]:10.2f} times  '
        f'{claim("channels.last_ratio")}'
    )
    return '\n'.join(lines)


def _block_lines(part: dict[str, Any], claim: Callable[[str], str]) -> list[str]:
    ns, agreement = part['ns_per_row'], part['agreement']
    in_cpp = (
        f'left out: {part["cpp_left_out"]}'
        if part['cpp_ratio'] is None
        else f'{ns["cpp_in_pieces"]:10.1f} ns a row, {part["cpp_command"]}'
    )
    lines = [
        f'Blocks       {part["rows"]:,} rows of {part["channels"]} channels, '
        f'least of {part["rounds"]} rounds; all rows in one call:',
        f'  SlipChain.update           {ns["chain"]:10.1f} ns a row',
        f'  SciPy and NumPy            {ns["numpy"]:10.1f} ns a row',
        f'  speed-up                   {part["speedup"]:10.2f} times  {claim("blocks.speedup")}',
        f'  envelope and level kept    {ns["kept"]:10.1f} ns a row',
        f'  ratio to decisions alone   {part["whole_kept_ratio"]:10.2f} times  '
        f'{claim("blocks.whole_kept_ratio")}',
        f'  and {part["rows_per_call"]:,} rows a call:',
        f'    SlipChain.update         {ns["chain_in_pieces"]:10.1f} ns a row',
        f'    NumPy in place           {ns["in_place_in_pieces"]:10.1f} ns a row',
        f'    speed-up                 {part["in_place_speedup"]:10.2f} times  '
        f'{claim("blocks.in_place_speedup")}',
        f'    C++                      {in_cpp}',
    ]
    if part['cpp_ratio'] is not None:
        lines.append(
            f'    run time over that       {part["cpp_ratio"]:10.2f} times  '
            f'{claim("blocks.cpp_ratio")}'
        )
    for label, name in (
        ('envelope and level kept', 'kept'),
        ('median as common mode', 'median'),
        ('decision by evidence', 'evidence'),
    ):
        ratio = f'{name}_ratio'
        lines += [
            f'    {label:<23}  {ns[name + "_in_pieces"]:10.1f} ns a row',
            f'    ratio to decisions alone {part[ratio]:10.2f} times  {claim("blocks." + ratio)}',
        ]
    shares = ', '.join(f'{rival} {share:.5%}' for rival, share in agreement.items())
    return [
        *lines,
        f'  equal decisions            {shares} (slip in {part["slip_share"]:.0%} of the rows)',
    ]
