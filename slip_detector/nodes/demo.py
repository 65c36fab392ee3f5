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

"""``slip_demo``: driver and detector as two processes, and what a grasp controller would get."""

import argparse
import json
from pathlib import Path

from slip_detector.commands import command_line
from slip_detector.nodes.run import run


def run_demonstration(parser: argparse.ArgumentParser) -> None:
    """Run the demonstration of a command, and end the process if it fails or is interrupted.

    The demonstration is the function of the command's name in
    :mod:`slip_detector.nodes.demonstrations`, which takes long to load. The function gets the
    arguments and the path of the picture; it returns the figures, which are written, and words
    about them, which are printed. A ValueError or OSError gives one line on stderr, with exit
    code 1; an interruption by a signal gives one line, with code 0.
    """
    parser.add_argument('--out', type=Path, default=Path('out'), help='folder for the results')
    parser.add_argument('--verbose', action='store_true', help='what the nodes log')
    arguments = parser.parse_args()
    file = arguments.out / f'{parser.prog.removeprefix("slip_")}.json'
    picture = file.with_suffix('.png')

    def work() -> str:
        from slip_detector.nodes import demonstrations
        from slip_detector.parameters.files import whole_file, writable_folder

        writable_folder(arguments.out)
        result, text = getattr(demonstrations, parser.prog)(arguments, picture)
        with whole_file(file) as new:
            new.write_text(json.dumps(result, indent=2) + '\n')
        return f'{text}\nPicture: {picture}; figures: {file}\nNext: make view; docs/your_sensor.md'

    interrupted = f'{parser.prog}: interrupted before it was done'
    run(parser.prog, lambda _: command_line.run(parser.prog, work), interrupted)


def main() -> None:
    """Entry point of ``slip_demo``."""
    parser = argparse.ArgumentParser(prog='slip_demo', description=__doc__)
    parser.add_argument('--scene', default='plate_400um', help='name or path of the scene')
    parser.add_argument('--seed', type=int, default=0, help='seed of the scene')
    parser.add_argument(
        '--record', metavar='FILE',
        help='write the trial with its labels: .mcap, .db3, .npz, .csv, or a folder that is a bag',
    )  # fmt: skip
    run_demonstration(parser)


if __name__ == '__main__':
    main()
