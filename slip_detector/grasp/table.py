"""The figures of the grasp as text."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from slip_detector.grasp.loop import CONTROLLER

#: What the controller has to stay below, and what it is in words.
WANTED = {
    'dropped': (1, 'objects dropped'),
    'worst_slide_mm': (5.0, 'worst slide [mm]'),
    'mean_slide_mm': (2.0, 'mean slide [mm]'),
    'force_percent': (60.0, 'mean grip [% of the limit]'),
}


def judged(controller: Mapping[str, Any]) -> dict[str, Any]:
    """Hold the controller's figures against what is wanted; what is not defined is not met."""
    found = {}
    for name, (below, _) in WANTED.items():
        value = controller[name]
        found[name] = {'value': value, 'below': below, 'met': value is not None and value < below}
    return found


def table(result: Mapping[str, Any]) -> str:
    """Lay the figures out: the conditions, what is wanted, and the trials through the nodes.

    Parameters
    ----------
    result
        As :mod:`slip_detector.nodes.grasp_demo` has it.
    """
    seeds, parts = result['seeds'], result['conditions']
    rows = [['', '', 'slide [mm]', '', 'grip [% of limit]', '', ''],
            ['', 'dropped', 'mean', 'worst', 'mean', 'most', 'onsets']]  # fmt: skip
    for name, part in parts.items():
        figures = [
            _cell(part[key], form)
            for key, form in (
                ('mean_slide_mm', '.2f'),
                ('worst_slide_mm', '.2f'),
                ('force_percent', '.1f'),
                ('most_force_percent', '.1f'),
                ('onsets', '.1f'),
            )
        ]
        rows.append([name, f'{part["dropped"]} of {part["trials"]}', *figures])
    needed = parts[CONTROLLER]['needed_percent']
    lines = [
        f'{len(seeds)} objects (seeds {seeds[0]} to {seeds[-1]}): gripped, lifted and filled '
        'until they are two to three times as heavy',
        f'In simulated time, {result["transport_ms"]:g} ms from sample to command',
        '',
        *_aligned(rows),
        '',
        f'A grip that knew weight and friction, always just enough: {needed:.1f} % of the limit.',
        '',
        'Wanted of the controller',
        '',
        *_aligned(
            [
                WANTED[name][1],
                _cell(entry['value'], '.2f'),
                f'wanted < {entry["below"]:g}',
                'met' if entry['met'] else 'NOT met',
            ]
            for name, entry in result['wanted'].items()
        ),
    ]
    if result['nodes']:
        lines += ['', *_through_nodes(result)]
    return '\n'.join(lines)


def _through_nodes(result: Mapping[str, Any]) -> list[str]:
    rows = [['', 'slide [mm]', '', 'command [% of limit]', ''],
            ['seed', 'nodes', 'simulated', 'nodes', 'simulated']]  # fmt: skip
    for seed, part in result['nodes'].items():
        both = (part, part['simulated'])
        slides = [_cell(entry['slide_mm'], '.2f') for entry in both]
        rows.append([seed, *slides, *(_cell(entry['command_percent'], '.1f') for entry in both)])
    latency = result['latency_ms']
    says = 'undefined, no onset was answered'
    if latency:
        says = f'median {latency["median"]:.1f} ms, most {latency["most"]:.1f} ms'
    return [
        'Through driver, detector and controller in real time, beside the same in simulated time',
        '',
        *_aligned(rows),
        '',
        f'From sample to command: {says}',
    ]


def _cell(value: float | None, form: str) -> str:
    return '-' if value is None else format(value, form)


def _aligned(rows: Iterable[Sequence[str]]) -> list[str]:
    """Lay rows of text out in columns, the first to the left and the others to the right."""
    lines = [list(row) for row in rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return [
        '  '.join(['', first.ljust(widths[0]), *map(str.rjust, rest, widths[1:])]).rstrip()
        for first, *rest in lines
    ]
