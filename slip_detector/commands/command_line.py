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

"""What all commands share: errors of one line, exit codes, interrupts, output into a closed pipe.

The commands start here. Loading the modules that compute takes a second, in which Ctrl-C must not
end in a traceback either: therefore this module imports nothing large.
"""

import argparse
import contextlib
import functools
import importlib
import math
import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from types import FrameType
from typing import NoReturn

#: Exit code after Ctrl-C or SIGTERM.
INTERRUPTED = 130

#: Characters that are kept of the beginning and of the end of a message that is too long.
KEPT = 1500, 450


def one_line(message: object) -> str:
    r"""Return an error or a text as one line; of a long one, the beginning and the end.

    Examples
    --------
    >>> one_line('rest\n1.npz: is no recording'), len(one_line('a' * 100_000))
    ('rest 1.npz: is no recording', 1955)
    >>> print(one_line('\x1b[2J.npz'))
    \x1b[2J.npz
    """
    line, (first, last) = ' '.join(str(message).split()), KEPT
    line = ''.join(each if each.isprintable() else ascii(each)[1:-1] for each in line)
    return line if len(line) <= first + last else f'{line[:first]} ... {line[-last:]}'


class Parser(argparse.ArgumentParser):
    """A parser that says in one line what is wrong with the arguments."""

    def error(self, message: str) -> NoReturn:
        """End the process with the exit code 2."""
        self.exit(2, f'{self.prog}: {one_line(message)} ({self.prog} --help says more)\n')


def whole_number(low: int, high: int = 10**9) -> Callable[[str], int]:
    """Return a function that reads an argument that is a whole number from ``low`` to ``high``."""

    def read(text: str) -> int:
        # Only ASCII digits, and fewer than int() refuses.
        number = int(text) if re.fullmatch('[0-9]{1,18}', text) else -1
        if not low <= number <= high:
            allowed = f'a whole number, {low} to {high}'
            raise argparse.ArgumentTypeError(f'is {text!r}, allowed: {allowed}')
        return number

    return read


def positive_number(text: str) -> float:
    """Read an argument that is a number above 0."""
    with contextlib.suppress(ValueError):
        if 0.0 < (number := float(text)) < math.inf:
            return number
    raise argparse.ArgumentTypeError(f'is {text!r}, allowed: a number above 0')


@contextlib.contextmanager
def interrupts_noted(message: str = '') -> Iterator[Callable[[], bool]]:
    """Within this context Ctrl-C and SIGTERM raise KeyboardInterrupt; the first may be noted.

    Parameters
    ----------
    message
        What to write to stderr when the first interrupt is noted.

    Yields
    ------
    callable
        Returns whether an interrupt was noted. Before its first call none is noted, and each
        raises; afterwards the second one raises.

    Examples
    --------
    >>> with interrupts_noted('stopping') as stop:
    ...     stop()
    False
    """
    noting = noted = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal noted
        if noted or not noting:
            raise KeyboardInterrupt
        noted = True
        with contextlib.suppress(OSError):  # Python's own stderr may be in the midst of a line.
            os.write(2, message.encode())

    def stop() -> bool:
        nonlocal noting
        noting = True
        return noted

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def run(name: str, work: Callable[[], str]) -> int:
    """Do the work of a command and print what it returns.

    Parameters
    ----------
    name
        Name of the command.
    work
        Returns the text to print; raises a ValueError or OSError where the user has made an error.

    Returns
    -------
    int
        The exit code: 0, or 1 after an error, which is one line on stderr; the ``advice`` of an
        error, if it has any, is printed. A full disk is an error, but a reader that stops early,
        like ``head``, is not.

    Examples
    --------
    >>> run('slip_evaluate', lambda: '3 slips, 3 detected')
    3 slips, 3 detected
    0
    """
    code = 0
    try:
        text = work()
    except BrokenPipeError:  # Nobody reads how far it is.
        text = ''
    except (ValueError, OSError) as error:  # OSError: a name that is too long, for example.
        sys.stderr.write(f'{name}: {one_line(error)}\n')
        text, code = getattr(error, 'advice', ''), 1
        if not text:
            return code
    try:
        print(text, flush=True)
    except OSError as error:
        # The interpreter flushes the rest of the buffer at exit, which must not fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            sys.stderr.write(f'{name}: the output cannot be written ({error.strerror})\n')
            return 1
    return code


def _start(command: str) -> int:
    try:
        with interrupts_noted():
            return int(importlib.import_module(f'slip_detector.commands.{command}').main())
    except KeyboardInterrupt as interrupt:
        sys.stderr.write(f'slip_{command}: {str(interrupt) or "ended before it was done"}\n')
        return INTERRUPTED


#: What starts each command.
evaluate, tune, compile_all = (
    functools.partial(_start, command) for command in ('evaluate', 'tune', 'compile')
)
