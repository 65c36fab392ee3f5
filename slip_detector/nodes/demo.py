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

"""Play a scene through driver and detector, and say what a grasp controller would get."""

from slip_detector.commands.command_line import Parser
from slip_detector.nodes.run import run_demonstration


def main() -> None:
    """Entry point of ``slip_demo``."""
    parser = Parser(prog='slip_demo', description=__doc__)
    parser.add_argument('--scene', default='plate_400um', help='its name or path (%(default)s)')
    parser.add_argument('--seed', type=int, default=0, help='seed of its noise (%(default)s)')
    parser.add_argument(
        '--record', metavar='FILE',
        help='write the trial with its labels: .mcap, .db3, .npz, .csv, or a folder that is a bag',
    )  # fmt: skip
    run_demonstration(parser)


if __name__ == '__main__':
    main()
