"""A bar that shows how far a command is."""

import sys
from typing import Any

from tqdm import tqdm


def progress_bar(total: int, unit: str, done: int = 0) -> 'tqdm[Any]':
    """Return a bar on stderr; it is disabled where that is no terminal.

    Parameters
    ----------
    total, done
        How many there are and how many of them are done.
    unit
        What is counted.
    """
    bar: tqdm[Any] = tqdm(
        total=total, initial=done, unit=unit, disable=not sys.stderr.isatty(), file=sys.stderr,
        dynamic_ncols=True,
    )  # fmt: skip
    return bar
