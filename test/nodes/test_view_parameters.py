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

"""The parameters of a real detector: read, set, saved, and a detector that is gone."""

import asyncio
import contextlib
import signal

import pytest

from slip_detector.nodes import view_fingers
from slip_detector.nodes.view_fingers import RemoteDetector
from slip_detector.parameters.detector import DetectorConfig


@pytest.fixture
def remote(bench):
    """The client of a detector."""
    remote = RemoteDetector(bench.node, '/slip_detector')
    yield remote
    remote.close()


def read(remote):
    """Read as soon as the detector answers: it may take its time to start."""

    async def until_there():
        while True:
            with contextlib.suppress(ValueError):
                return await remote.read()

    return asyncio.run(asyncio.wait_for(until_there(), 90.0))


def test_all_parameters_are_read_and_set_or_refused_as_a_whole(bench, remote):
    bench.start('slip_detector', parameters={'exponent': 2})
    wanted = DetectorConfig(exponent=2).to_parameters()
    assert wanted.items() <= read(remote).items()

    def set_all(values):
        return asyncio.run(remote.set(values))

    most = {'channels': 5_000, 'disabled_channels': list(range(17, 5_001))}
    most |= {'envelope_window_s': 60.0, 'sample_rate_hz': 5e4}
    for words, values in {
        "parameter threshold is 'low', allowed: a number": {'threshold': 'low', 'gain': 2.0},
        'read-only': {'autostart': False, 'gain': 2.0},
        'cannot be deleted': {'gain': None},
        'did you mean threshold': {'threshhold': 0.4, 'gain': 2.0},
        'installed message type': {'input_type': 'std_msgs/msg/__name__', 'gain': 2.0},
        'channels is 5000: .* GB of memory': most,
        "'utf-8' codec can't encode": {'input_field': '\ud800'},
        'cannot be sent to the detector': {'input_field': {}},
        'threshold is 1000.*, allowed: a number of 64 bits': {'threshold': 10**400},
        'noise_floor is 1000.*, allowed: a number of 64 bits': {'noise_floor': [1, 10**400]},
    }.items():
        with pytest.raises(ValueError, match=words):
            set_all(values)
    some = {'threshold': 1, 'stopbands_hz': [0.5, 7.25], 'channel_names': [], 'vote': 'mean'}
    some['noise_floor'] = [0.5]
    set_all(some)
    assert some.items() <= read(remote).items()
    others = {f'groups.{name}': None for name in ('TP', 'TD', 'LR', 'LU')} | {'channels': 2}
    others |= {'noise_floor': [1, 0.5], 'groups.front': [2, 1]}
    set_all(others)
    values = read(remote)
    assert (values['channels'], values['noise_floor']) == (2, [1.0, 0.5])
    assert (values['threshold'], values['gain']) == (1.0, 100.0)
    assert {name for name in values if name.startswith('groups.')} == {'groups.front'}


def test_a_detector_that_hangs_or_is_gone_is_reported_within_the_deadline(
    bench, remote, monkeypatch
):
    process = bench.start('slip_detector')
    read(remote)
    asyncio.run(remote.set({'threshold': 0.25}))
    process.signal(signal.SIGSTOP)
    monkeypatch.setattr(view_fingers, 'ANSWER_S', 1.0)
    with pytest.raises(ValueError, match='is not known whether this was set: /slip_detector has'):
        asyncio.run(remote.set({'threshold': 0.75}))
    process.signal(signal.SIGCONT)
    monkeypatch.setattr(view_fingers, 'ANSWER_S', 60.0)
    # An answer that came too late is not taken for that to the next question.
    with pytest.raises(ValueError, match='is -1'):
        asyncio.run(remote.set({'threshold': -1}))
    assert read(remote)['threshold'] == 0.75
    remote.close()
    with pytest.raises(ValueError, match='/slip_detector ended before it answered'):
        asyncio.run(remote.set({'threshold': 0.5}))
