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

"""Shared by all subcommands: options, run times, noise, the machine, verdicts, figures as text.

A machine's speed differs from hour to hour; the ratio of two run times measured in turns hardly
does. So every claim about speed is a ratio: the sides take turns (A B A B ...), and the shortest
time of each counts, because it was disturbed least.
"""

import argparse
import importlib
import json
import os
import platform
import time
import timeit
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy
import yaml
from numpy.typing import NDArray

from slip_detector.compiled import COMPILED
from slip_detector.report.texts import number_text, text_table

#: Noise that :func:`swelling_noise_v` makes.
BASELINE_V, NOISE_V = 4.3, 0.02


def shared_options(command: str, description: str, picture: str = '') -> argparse.ArgumentParser:
    """Return a parser with the options that all subcommands have, for ``command``.

    With ``picture``, its file by default, there is ``--plot``, too.
    """
    options = argparse.ArgumentParser(
        prog=f'python -m benchmarks {command}',
        description=f'{description} Says of each figure what is wanted and whether it is met; the '
        'exit code is 0 either way.',
    )
    options.add_argument('--json', action='store_true', help='print one JSON object instead')
    options.add_argument(
        '--quick', action='store_true', help='short and inexact, not to be quoted'
    )
    if picture:
        options.add_argument(
            '--plot', metavar='FILE', nargs='?', const=picture, type=Path,
            help='draw the error against run time (default FILE: %(const)s)',
        )  # fmt: skip
    return options


def machine() -> dict[str, Any]:
    """Return the facts about machine and software on which run times depend.

    Returns
    -------
    dict
        ``cores``, ``system``, ``processor``, ``python``, ``numpy``, ``scipy``, ``numba`` (None
        when it is missing) and ``compiled``, whether the package runs with Numba.
    """
    lines = Path('/proc/cpuinfo').read_text().splitlines()
    names = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    return {
        'cores': os.cpu_count(),
        'system': f'{platform.system()} {platform.release()}',
        'processor': ', '.join([*names[:1], platform.machine()]),
        'python': platform.python_version(),
        'numpy': np.__version__,
        'scipy': scipy.__version__,
        'numba': importlib.import_module('numba').__version__ if COMPILED else None,
        'compiled': COMPILED,
    }


class Bound(NamedTuple):
    """The range in which a figure is wanted, from ``low`` to ``high``.

    Attributes
    ----------
    low, high : float
        In the unit of the figure.
    strict : bool
        Whether a figure equal to ``low`` or ``high`` is outside the range.

    Examples
    --------
    >>> Bound(high=4.0).met(4.0), Bound(high=4.0, strict=True).met(4.0), Bound(low=1.0).met(None)
    (True, False, False)
    >>> print(Bound(low=0.0, strict=True), Bound(high=4.0), Bound(32.0, 40.0), sep=', ')
    > 0, <= 4, 32.00 to 40.00
    """

    low: float = -np.inf
    high: float = np.inf
    strict: bool = False

    def met(self, figure: float | None) -> bool:
        """Return whether a figure is in the range; None, a figure that is not defined, is not."""
        if figure is None or (self.strict and figure in (self.low, self.high)):
            return False
        return self.low <= figure <= self.high

    def __str__(self) -> str:
        equal = '' if self.strict else '='
        if self.high == np.inf:
            return f'>{equal} {self.low:g}'
        if self.low == -np.inf:
            return f'<{equal} {self.high:g}'
        return f'{self.low:.2f} to {self.high:.2f}'


def verdicts(
    bounds: Mapping[str, Bound], figures: Mapping[str, Any], judged: bool = True
) -> dict[str, dict[str, Any]]:
    """Compare measured figures with their bounds.

    Parameters
    ----------
    bounds
        The wanted bounds, by claim: ``part.figure``.
    figures
        What was measured: the figures of each part; parts may be missing.
    judged
        False when the measurement is too short to be judged.

    Returns
    -------
    dict
        For each claim ``value``, ``bound`` (as text) and ``met``, which is None when nothing was
        measured or judged.

    Examples
    --------
    >>> verdicts({'blocks.speedup': Bound(low=10.0)}, {'blocks': {'speedup': 12.5}})
    {'blocks.speedup': {'value': 12.5, 'bound': '>= 10', 'met': True}}
    """
    found = {}
    for claim, bound in bounds.items():
        part, figure = claim.split('.')
        value = figures.get(part, {}).get(figure)
        met = bound.met(value) if judged and value is not None else None
        found[claim] = {'value': value, 'bound': str(bound), 'met': met}
    return found


def as_text(
    figures: Mapping[str, Any], as_table: Callable[[Mapping[str, Any]], str] | None = None
) -> str:
    """Return what ``--json`` prints as text: the machine, the claims as a table, all figures.

    ``as_table`` returns all figures as text; without it they are in the form of YAML.
    """
    facts, parts = figures['machine'], dict(figures)
    for name in ('machine', 'quick', 'wanted'):
        del parts[name]
    how = f'Numba {facts["numba"]}' if facts['compiled'] else 'no Numba: interpreted'
    words = {None: 'not judged', True: 'met', False: 'NOT met'}
    rows = [('What', 'measured', 'wanted', '')] + [
        (claim, number_text(entry['value'], '.4g'), entry['bound'], words[entry['met']])
        for claim, entry in figures['wanted'].items()
        if entry['value'] is not None
    ]
    return '\n'.join(
        (
            f'Machine      {facts["cores"]} cores, {facts["processor"]}, {facts["system"]}',
            f'             Python {facts["python"]}, NumPy {facts["numpy"]}, '
            f'SciPy {facts["scipy"]}, {how}',
            'Ratios compare run times measured in turns, the shortest of all rounds for each side'
            + (' (--quick: few and short).' if figures['quick'] else '.'),
            '',
            text_table(rows, '<>><', indent=0),
            '',
            # By way of JSON, as YAML does not take tuples and NumPy's numbers.
            as_table(parts)
            if as_table
            else yaml.safe_dump(json.loads(json.dumps(parts)), sort_keys=False),
        )
    )


def swelling_noise_v(
    rows: int, n_channels: int, seed: int = 0, period_rows: float = 760.0
) -> NDArray[np.float64]:
    """Make noise around a baseline, shape (rows, n_channels), that swells and fades.

    Parameters
    ----------
    rows, n_channels
        Shape of the result.
    seed
        Seed of the noise.
    period_rows
        Rows from one swell to the next; 760 are 2 s at 380 Hz.
    """
    random = np.random.default_rng(seed)
    swell_v = NOISE_V * (1 + np.sin(2 * np.pi * np.arange(rows) / period_rows))
    return np.asarray(BASELINE_V + swell_v[:, None] * random.standard_normal((rows, n_channels)))


def least_times_s(
    sides: Sequence[Callable[[], object]],
    rounds: int,
    clock: Callable[[], float] = time.perf_counter,
) -> list[float]:
    """Run the sides in turns and return the shortest time of each.

    Each side first runs once unmeasured, so that its memory is allocated and its caches are warm.

    Parameters
    ----------
    sides
        The functions to time.
    rounds
        How often each side is run.
    clock
        Returns seconds. ``time.thread_time`` leaves out the time in which other processes have the
        processor; it is right for sides that neither wait nor start threads.

    Returns
    -------
    list of float
        Seconds, in the order of the sides.

    Examples
    --------
    >>> words = []
    >>> times_s = least_times_s([lambda: words.append('a'), lambda: words.append('b')], rounds=2)
    >>> ''.join(words), len(times_s)
    ('ababab', 2)
    """
    # A Timer switches the garbage collector off, which would slow down only one side.
    timers = [timeit.Timer(side, timer=clock) for side in sides]
    for timer in timers:
        timer.timeit(1)
    least_s = np.min([[timer.timeit(1) for timer in timers] for _ in range(rounds)], axis=0)
    return [float(side_s) for side_s in least_s]
