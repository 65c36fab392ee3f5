"""Times of things that take turns.

A machine's speed differs from hour to hour; the ratio of two things that take turns hardly does.
So every claim about speed is a ratio: the two sides take turns (A B A B ...), and the least time
of each counts, which is the one that nothing disturbed.
"""

import contextlib
import gc
import time
from collections.abc import Callable, Iterator, Sequence


def least_times_s(sides: Sequence[Callable[[], None]], rounds: int) -> list[float]:
    """Let the sides take turns and return the least time of each.

    Each side runs once before, unmeasured, so that its memory and caches are in place.

    Parameters
    ----------
    sides
        What is timed.
    rounds
        How often each side has its turn.

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
    for side in sides:
        side()
    least_s = [float('inf')] * len(sides)
    with garbage_collection_off():
        for _ in range(rounds):
            for i, side in enumerate(sides):
                start_s = time.perf_counter()
                side()
                least_s[i] = min(least_s[i], time.perf_counter() - start_s)
    return least_s


@contextlib.contextmanager
def garbage_collection_off() -> Iterator[None]:
    """Keep the garbage collector off within a block: it would run in one side only."""
    was_on = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
