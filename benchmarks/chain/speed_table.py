"""The figures of the chain's speed as text."""

from typing import Any

from benchmarks.chain.speed import CHANNEL_COUNTS
from benchmarks.verdicts import claim_in_words


def chain_speed_table(figures: dict[str, Any]) -> str:
    """Return the figures of :func:`~benchmarks.chain.speed.measure_chain_speed` as text."""

    def claim(name: str) -> str:
        return claim_in_words(figures['wanted'][name])

    part, tuned = figures['blocks'], figures['blocks']['tuned']
    agreement = ', '.join(f'{name} {share:.5%}' for name, share in part['agreement'].items())
    lines = [
        f'Blocks       {part["rows"]:,} rows of {part["channels"]} channels, '
        f'least of {part["rounds"]} rounds',
        f'  SlipChain.update           {part["chain_ns_per_row"]:10.1f} ns a row',
        f'  SciPy and NumPy            {part["numpy_ns_per_row"]:10.1f} ns a row',
        f'  speed-up                   {part["speedup"]:10.2f} times  {claim("blocks.speedup")}',
        f'  and with NumPy in place, both {tuned["rows_per_call"]:,} rows a call:',
        f'    SlipChain.update         {tuned["chain_ns_per_row"]:10.1f} ns a row',
        f'    SciPy and NumPy          {tuned["numpy_ns_per_row"]:10.1f} ns a row',
        f'    speed-up                 {tuned["speedup"]:10.2f} times',
        f'  equal decisions            {agreement} (slip in {part["slip_share"]:.0%} of the rows)',
    ]
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
    return '\n'.join(lines)
