"""The figures of the paper's protocol as text."""

from collections.abc import Mapping, Sequence
from typing import Any

from slip_detector.evaluation.protocol_trials import SCENES, band_name

#: The claims in words.
MEANINGS = {
    'detected_percent': 'trials detected [%]',
    **{
        f'mean_delay_ms.{plate}': f'mean delay, {plate} um, within the sd of the paper [ms]'
        for plate in SCENES
    },
    'least_rise_ms': 'least rise of the mean delay from plate to plate [ms]',
    'worst_false_positive_percent': 'false positives, worst plate [% of the time without slip]',
    'windows.20.false_positive_percent_more': 'false positives, windows of 20 ms less 40 ms [%]',
    'windows.30.false_positive_percent_more': 'false positives, windows of 30 ms less 40 ms [%]',
    'bands.10-100.least_shortening_ms': 'delay saved by [10, 100] Hz, least of the plates [ms]',
    'bands.10-150.least_shortening_ms': 'delay saved by [10, 150] Hz, least of the plates [ms]',
}


def protocol_table(result: Mapping[str, Any]) -> str:
    """Lay the figures out as text, the paper's beside ours, what is wanted at the end."""
    plates, paper = result['plates'], result['paper']
    seeds = result['seeds']
    heads = ['', *(f'{plate} um' for plate in plates), 'all']
    columns = [*plates.values(), result['all']]

    def row(head: str, key: str, form: str = '.2f') -> list[str]:
        return [head, *(_cell(column[key], form) for column in columns)]

    def paper_row(head: str, key: str) -> list[str]:
        return [head, *(_cell(paper['plates'][plate][key], '.2f') for plate in plates), '']

    lines = [
        f"The paper's protocol: {len(plates)} plates, {len(seeds)} trials on each, "
        f'seeds {seeds[0]} to {seeds[-1]}',
        'Delay [ms] from the start of the plate to the first ON, mean over the channels (Eq. 10)',
        '',
    ]
    trials = [
        [f'seed {seed}', *(_cell(plates[plate]['trial_delays_ms'][k], '.2f') for plate in plates)]
        for k, seed in enumerate(seeds)
    ]
    lines += _aligned(
        [
            heads,
            *([*line, ''] for line in trials),
            row('mean', 'mean_delay_ms'),
            paper_row('mean, paper', 'mean_delay_ms'),
            row('sd', 'sd_delay_ms'),
            paper_row('sd, paper', 'sd_delay_ms'),
            ['detected', *(_of(column) for column in columns)],
            ['success [%]', *(f'{_success_percent(column):.1f}' for column in columns)],
            row('false positives [%]', 'false_positive_percent'),
            [
                'false positives, paper [%]',
                *([''] * len(plates)),
                f'{paper["false_positive_percent"]:.2f}',
            ],
            row('channels without ON', 'channels_without_on', 'd'),
        ]
    )
    lines += [
        '',
        "False positives: share of the time at which the plate stands. The paper's delays of the "
        'single trials are not at hand.',
    ]
    heads = ['', *(f'{plate} um' for plate in plates), 'detected', 'false positives [%]']
    windows = [_variant(f'{name} ms', part) for name, part in result['windows'].items()]
    lines += ['', 'Mean delay [ms] by the length of both windows (as Fig. 4)', '']
    lines += _aligned([heads, *windows])
    bands = [_variant('as configured', result)]
    bands += [_variant(band_name(name), part) for name, part in result['bands'].items()]
    lines += ['', 'Mean delay [ms] by band (as Fig. 7)', '']
    lines += _aligned([heads, *bands])
    lines += ['', 'Wanted', '']
    lines += _aligned(
        [
            [
                MEANINGS[name],
                _cell(entry['value'], '.2f'),
                f'wanted {entry["bound"]}',
                'met' if entry['met'] else 'NOT met',
            ]
            for name, entry in result['wanted'].items()
        ]
    )
    if result['plots']:
        lines += ['', f'Written: {", ".join(result["plots"])}']
    return '\n'.join(lines)


def _variant(head: str, part: Mapping[str, Any]) -> list[str]:
    means = [_cell(mine['mean_delay_ms'], '.2f') for mine in part['plates'].values()]
    false_percent = _cell(part['all']['false_positive_percent'], '.2f')
    return [head, *means, _of(part['all']), false_percent]


def _success_percent(part: Mapping[str, Any]) -> float:
    return float(100.0 * part['detected'] / part['trials'])


def _of(part: Mapping[str, Any]) -> str:
    return f'{part["detected"]} of {part["trials"]}'


def _cell(value: float | None, form: str) -> str:
    return '-' if value is None else format(value, form)


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lay rows of text out in columns, the first to the left and the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        '  '.join(['', first.ljust(widths[0]), *map(str.rjust, rest, widths[1:])]).rstrip()
        for first, *rest in rows
    ]
