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

"""Shared by all subcommands: options, the form of the result, and facts about the machine."""

import argparse
import importlib
import os
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

from slip_detector.chain.compiled import COMPILED


class Measurement(NamedTuple):
    """What a subcommand has measured.

    Attributes
    ----------
    figures : dict
        The object that ``--json`` prints.
    text : str
        The same figures as tables.
    """

    figures: dict[str, Any]
    text: str


def shared_options(command: str, description: str, picture: str = '') -> argparse.ArgumentParser:
    """Return a parser with the options that all subcommands have.

    Parameters
    ----------
    command
        Name of the subcommand.
    description
        What it measures.
    picture
        File that ``--plot`` writes if it names none; empty for a subcommand without ``--plot``.
    """
    options = argparse.ArgumentParser(
        prog=f'python -m benchmarks {command}', description=description
    )
    options.add_argument('--json', action='store_true', help='print one JSON object instead')
    options.add_argument(
        '--quick', action='store_true', help='short and inexact, not to be quoted'
    )
    if picture:
        options.add_argument(
            '--plot', metavar='FILE', nargs='?', const=Path(picture), type=Path,
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
    return {
        'cores': os.cpu_count(),
        'system': f'{platform.system()} {platform.release()}',
        'processor': _processor(),
        'python': platform.python_version(),
        'numpy': np.__version__,
        'scipy': scipy.__version__,
        'numba': importlib.import_module('numba').__version__ if COMPILED else None,
        'compiled': COMPILED,
    }


def _processor() -> str:
    """Return the name of the processor, if the system provides it, and its architecture."""
    lines = Path('/proc/cpuinfo').read_text().splitlines()
    names = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    return ', '.join([*names[:1], platform.machine()])


def heading(figures: Mapping[str, Any]) -> str:
    """Return the lines above the tables: the machine, and how run times are measured.

    Parameters
    ----------
    figures
        Figures with the keys ``machine`` and ``quick``.
    """
    facts = figures['machine']
    how = f'Numba {facts["numba"]}' if facts['compiled'] else 'no Numba: interpreted'
    return '\n'.join(
        (
            f'Machine      {facts["cores"]} cores, {facts["processor"]}, {facts["system"]}',
            f'             Python {facts["python"]}, NumPy {facts["numpy"]}, '
            f'SciPy {facts["scipy"]}, {how}',
            'Ratios compare run times measured in turns, the shortest of all rounds for each side'
            + (' (--quick: few and short).' if figures['quick'] else '.'),
        )
    )
