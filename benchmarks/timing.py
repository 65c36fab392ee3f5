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

"""Measures the run times of functions in turns.

A machine's speed differs from hour to hour; the ratio of two run times measured in turns hardly
does. So every claim about speed is a ratio: the sides take turns (A B A B ...), and the shortest
time of each counts, because it was disturbed least.
"""

import contextlib
import gc
import time
from collections.abc import Callable, Iterator, Sequence


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
    for side in sides:
        side()
    least_s = [float('inf')] * len(sides)
    with garbage_collection_off():
        for _ in range(rounds):
            for i, side in enumerate(sides):
                start_s = clock()
                side()
                least_s[i] = min(least_s[i], clock() - start_s)
    return least_s


@contextlib.contextmanager
def garbage_collection_off() -> Iterator[None]:
    """Switch the garbage collector off within a block; it would slow down only one side."""
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
