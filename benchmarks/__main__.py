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

"""The command line of the benchmarks: ``python -m benchmarks COMMAND``, from a checkout.

``--json`` prints one object. Common to all subcommands are its keys ``machine`` (see
:func:`benchmarks.measurement.machine`), ``quick`` (whether the measurement was short) and
``wanted``: for each claim, by ``part.figure``, the measured ``value``, the ``bound`` as text and
whether it is ``met``; both are null where it was not measured, and ``met`` with ``--quick``. The
others are in the docstring of each ``command.py``. Without ``--json`` the same is printed as text.
"""

import argparse
import importlib
import json
import signal
import sys

if not __package__:
    sys.exit('benchmarks: run it in the folder of the checkout as: python -m benchmarks')

from benchmarks.measurement import as_text, machine, verdicts

#: The subcommands. Each is a folder with a ``command.py``: ``options()`` returns a parser,
#: ``measure(words)`` takes the parsed arguments and returns the figures by part, and ``WANTED``
#: has the bounds of some of them, by ``part.figure``. ``as_table(figures)``, where there is one,
#: returns them as text.
COMMANDS = {
    'chain': 'run time and numerical error of the chain',
    'scenes': 'error of the simulated fingertip against run time',
    'extremes': 'stiff and extreme cases of the simulated fingertip',
    'tune': 'recordings read, evaluated and searched; what tuning brings',
    'paper': "the paper's protocol, its figures beside ours",
    'grasp': 'how far objects slide in a simulated grasp',
    'lessons': 'what teaching by late and careless hands brings',
    'fingers': 'real fingers: taught on a part of the recordings, judged on the rest',
    'soak': 'drivers and detectors that run for long',
    'view': 'the live page: frames, memory, and what it costs the detectors',
}


def main(arguments: list[str] | None = None) -> int:
    """Run one subcommand and print what it has measured; return the exit code."""
    parser = argparse.ArgumentParser(
        prog='python -m benchmarks',
        description='Measure how fast and how exact the package is.',
        epilog='commands:\n' + '\n'.join(f'  {name:<9} {what}' for name, what in COMMANDS.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('command', choices=COMMANDS, metavar='COMMAND', help='see below')
    parser.add_argument(
        'options', nargs=argparse.REMAINDER, help='see: python -m benchmarks COMMAND --help'
    )
    chosen = parser.parse_args(arguments)
    try:
        # On termination, too, what was started is ended.
        signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
        command = importlib.import_module(f'benchmarks.{chosen.command}.command')
        words = command.options().parse_args(chosen.options)
        parts = command.measure(words)
        wanted = verdicts(command.WANTED, parts, judged=not words.quick)
        figures = {'machine': machine(), 'quick': words.quick, **parts, 'wanted': wanted}
        table = getattr(command, 'as_table', None)
        print(json.dumps(figures, indent=2) if words.json else as_text(figures, table))
    except KeyboardInterrupt:
        return 130
    except (RuntimeError, OSError, ValueError, ModuleNotFoundError) as error:
        print(f'benchmarks: {error}', file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
