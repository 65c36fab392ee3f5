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

"""Random configurations of many channels in tiles."""

from hypothesis import strategies as st

from slip_detector.parameters.detector import ChainConfig


@st.composite
def configs(draw):
    channels = draw(st.integers(1, 70))
    order = draw(st.permutations(range(1, channels + 1)))
    enabled = order[: draw(st.integers(1, channels))]
    count = draw(st.integers(1, min(len(enabled), 5)))
    groups = {f'g{i}': tuple(enabled[i::count]) for i in range(count)}
    return ChainConfig(
        channels=channels,
        groups=groups,
        disabled_channels=order[len(enabled) :],
        common_mode=draw(st.sampled_from(['none', 'mean', 'median'])),
        vote=draw(st.sampled_from(['all', 'mean', 1])),
        valid_range_v=(-3.0, 4.0),
        decision=draw(st.sampled_from(['mean', 'evidence'])),
        noise_floor=[10.0**k for k in range(channels)] if channels < 30 else 0.1,
        impact_v=draw(st.sampled_from([0.0, 2.0])),
        impact_channels=1,
    )


def enabled_of(config):
    return [c for c in range(config.channels) if c + 1 not in config.disabled_channels]
