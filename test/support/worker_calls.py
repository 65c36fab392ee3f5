"""What the tests of workers have them call."""

import gc
import os
import signal
import weakref
from pathlib import Path

#: Of this process, the garbage of its calls so far.
GARBAGE = []


class Cycle:
    """Refers to itself: only the garbage collector can free it."""

    def __init__(self):
        self.itself = self


def garbage_left(number):
    """Return how much garbage of earlier calls in this process is still there, and leave more."""
    gc.collect()
    left = sum(cycle() is not None for cycle in GARBAGE)
    GARBAGE.append(weakref.ref(Cycle()))
    return left


def process_of(number):
    return number, os.getpid()


def refuse(number):
    raise ValueError(f'{number} is refused')


def zeros(number):
    """Return so many bytes."""
    return bytes(number)


def die(number):
    os.kill(os.getpid(), signal.SIGKILL)


def die_once(folder):
    """Kill this process, unless another has done so before."""
    try:
        (Path(folder) / 'died').touch(exist_ok=False)
    except FileExistsError:
        return
    os.kill(os.getpid(), signal.SIGKILL)
