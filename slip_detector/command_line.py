"""What the command lines share: errors of one line, output that may not be read to its end."""

import argparse
import os
import sys
from typing import NoReturn


class Parser(argparse.ArgumentParser):
    """Says what is wrong with the arguments in one line."""

    def error(self, message: str) -> NoReturn:
        """Leave with the exit code 2."""
        self.exit(2, f'{self.prog}: {message} ({self.prog} --help says more)\n')


def print_text(name: str, text: str) -> int:
    """Print; a reader that stops early, like ``head``, is no error, a full disk is.

    Parameters
    ----------
    name
        Of the command.
    text
        What to print.

    Returns
    -------
    int
        The exit code: 0, or 1 after an error, which is one line on stderr.
    """
    try:
        print(text, flush=True)
    except OSError as error:
        # What is left in the buffer must not fail again when the interpreter flushes it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            return 0
        sys.stderr.write(f'{name}: the output cannot be written ({error.strerror})\n')
        return 1
    return 0
