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

"""Find the slips in an array of voltages, without ROS.

Replace ``volts`` by rows of your own, with their rate in ``ChainConfig(sample_rate_hz=...)``.
"""

import numpy as np

from slip_detector import ChainConfig, SlipChain
from slip_detector.scenes import find_scene, load_scene


def slips_in(volts, config):
    """Find the slips in rows of voltages.

    Parameters
    ----------
    volts
        Voltages in V, shape (n, channels), oldest row first.
    config
        The chain's parameters.

    Returns
    -------
    ndarray
        First and last time at which the global decision is ON in s, shape (slips, 2), counted
        from the first row.
    """
    chain = SlipChain(config)
    slip = chain.update(volts).slip
    # A slip begins where the decision rises and ends before it falls.
    steps = np.diff(np.concatenate([[0], slip.astype(int), [0]]))
    first, end = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
    return np.column_stack([first, end - 1]) / config.sample_rate_hz


def main():
    """Print the slips of one simulated trial."""
    scene = load_scene(find_scene('plate_400um'), np.random.default_rng(0))
    volts = scene.read(10_000).volts
    for begin_s, end_s in slips_in(volts, ChainConfig()):
        print(f'slip from {begin_s:.3f} s to {end_s:.3f} s')


if __name__ == '__main__':
    main()
