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

"""What all sources have in common."""

import re
import time

import pytest

from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources import open_source
from support.sensors import free_udp_port


@pytest.fixture(params=['scene', 'recording', 'serial', 'udp'])
def source(request, tmp_path):
    recording = tmp_path / 'a.csv'
    recording.write_text('time_s,ch1,ch2\n0,1,2\n0.1,3,4\n')
    source = open_source(
        DriverConfig(
            source=request.param,
            scene='flat_plate',
            recording=str(recording),
            serial_port=str(tmp_path / 'tty'),
            udp_port=free_udp_port(),
            channels=2,
        ),
        now_ns=time.time_ns,
    )
    yield source
    source.close()


def test_a_source_says_what_it_is_and_gives_samples_of_its_channels(source):
    source.start()
    samples = source.read(2)
    n, channels = samples.volts.shape
    assert n == (0 if source.is_live else 2)
    assert channels == len(source.channel_names) > 0
    assert samples.stamps_ns.shape == (n,)
    assert samples.stamps_ns.dtype.kind == 'i'
    assert source.name
    assert bool(source.state) == source.is_live


def test_the_stamps_of_what_is_played_begin_at_zero(source):
    if not source.is_live:
        assert source.read(1).stamps_ns.tolist() == [0]
        assert source.read(1).stamps_ns.tolist() == [round(1e9 / source.sample_rate_hz)]


def test_a_source_without_an_object_refuses_a_grip_force(source):
    assert not source.has_object
    with pytest.raises(ValueError, match=f'^{re.escape(source.name)} has no object to hold$'):
        source.hold_force(1.0)
