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

"""The command ``slip_compile``.

Compile the chain, the simulated fingertip, evaluation and tuning, which otherwise happens when
each first runs. The result is kept on disk.

One run after each installation is enough. It has to be by the user who runs the nodes, as the
files may be in that user's cache.
"""

import time
from collections.abc import Sequence

import numpy as np

from slip_detector.chain.slip_chain import compile_chain
from slip_detector.commands.command_line import Parser, run
from slip_detector.compiled import COMPILED
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters import ChainConfig, DriverConfig, shared_folder
from slip_detector.sources import open_source
from slip_detector.tuning.sweep import vote_statistics
from slip_detector.tuning.tracks import track_of

NAME = 'slip_compile'

#: More samples than the default scene has: rest and slip.
WHOLE = 10_000


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return the exit code."""
    Parser(prog=NAME, description=__doc__.split('\n\n')[1]).parse_args(argv)
    return run(NAME, compile_all)


def compile_all() -> str:
    """Run everything with compiled functions on little data; return a line that sums it up."""
    if not COMPILED:
        return 'Nothing to compile: Numba is not installed, and everything runs interpreted.'
    began_s = time.monotonic()
    compile_chain()
    for path in sorted((shared_folder() / 'config' / 'scenes').glob('*.yaml')):
        source = open_source(DriverConfig(source='scene', scene=str(path)))
        source.read(1)
        if source.takes_orders:
            source.obey('slip')
    config = ChainConfig()
    samples = open_source(DriverConfig(source='scene')).read(WHOLE)
    Replay(config).run([samples])
    track = track_of('compiled', [samples], config.sample_rate_hz)
    for statistics in vote_statistics(config, ['all', 'mean', 2], [track]):
        statistics.events(np.array([0.5, 1.0]))
    return f'All is compiled, after {time.monotonic() - began_s:.0f} s.'
