"""What every subcommand has: its options, what it gives, and the machine it ran on."""

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
        What ``--json`` prints.
    text : str
        The same as tables.
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
        File that ``--plot`` without a file writes; a subcommand that draws nothing has no such
        option.
    """
    options = argparse.ArgumentParser(
        prog=f'python -m benchmarks {command}', description=description
    )
    options.add_argument('--json', action='store_true', help='print one JSON object instead')
    options.add_argument('--quick', action='store_true', help='short and rough: nothing to quote')
    if picture:
        options.add_argument(
            '--plot', metavar='FILE', nargs='?', const=picture,
            help='draw the error against run time (default FILE: %(const)s)',
        )  # fmt: skip
    return options


def machine() -> dict[str, Any]:
    """Return what the figures depend on.

    Returns
    -------
    dict
        ``cores``, ``system``, ``processor``, ``python``, ``numpy``, ``scipy``, ``numba`` (None
        where it is missing) and ``compiled``.
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
    """Return the name of the processor, where the system tells it, and its architecture."""
    known = Path('/proc/cpuinfo')
    lines = known.read_text().splitlines() if known.exists() else []
    names = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    return ', '.join([*names[:1], platform.machine()])


def heading(figures: Mapping[str, Any]) -> str:
    """Return on which machine and how was measured: the first lines of the tables.

    Parameters
    ----------
    figures
        With ``machine`` and ``quick``.
    """
    facts = figures['machine']
    how = f'Numba {facts["numba"]}' if facts['compiled'] else 'no Numba: interpreted'
    return '\n'.join(
        (
            f'Machine      {facts["cores"]} cores, {facts["processor"]}, {facts["system"]}',
            f'             Python {facts["python"]}, NumPy {facts["numpy"]}, '
            f'SciPy {facts["scipy"]}, {how}',
            'Ratios are of times taken in turns, the least of all rounds for each side'
            + (' (--quick: few and short).' if figures['quick'] else '.'),
        )
    )
