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

"""Writes what the detector publishes as a bag, to be looked at beside other topics."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.chain.samples import Bools, Samples
from slip_detector.chain.slip_chain import SlipResult
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.files import whole_file
from slip_detector.recordings.bag_recording import BOOL, JOINT_STATE
from slip_detector.recordings.bag_storage import HEADER
from slip_detector.recordings.messages import STATES, JointStateWriter, header
from slip_detector.recordings.writing import BOOLS, PLUGINS, check_new, new_bag

#: The topics whose messages have a stamp, and their types.
STAMPED = {'slip_state': JOINT_STATE, 'slip_onset': HEADER, 'slip_detector/envelope': JOINT_STATE}

#: Rows, and a chain's result for them.
Decided = Iterable[tuple[Samples, SlipResult]]


def write_decisions(path: Path, pieces: Decided, config: ChainConfig, namespace: str = '') -> None:
    """Write what the detector publishes on its topics, stamped as the samples.

    States are written with the first row, where they change and with the last row; the levels of
    all channels with each row.

    Parameters
    ----------
    path
        The new file, .mcap or .db3, or without ending the folder of a bag.
    pieces
        Rows, and a chain's result for them with the level.
    config
        The parameters of the chain.
    namespace
        Of the topics, for example ``/index``.

    Raises
    ------
    ValueError
        When the path exists already, has another ending or cannot be written; names it.

    Examples
    --------
    >>> import tempfile
    >>> from rosbags.highlevel import AnyReader
    >>> from slip_detector import SlipChain
    >>> rows = Samples.evenly(np.full((100, 16), 4.3), 380.0, truth=np.zeros(100))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'decisions.mcap'
    ...     write_decisions(path, [(rows, SlipChain().update(rows.volts))], ChainConfig())
    ...     with AnyReader([path]) as bag:
    ...         bag.topics['/slip_detector/envelope'].msgcount
    100
    """
    check_new(path, *PLUGINS)
    groups = [f'slip/group/{name}' for name in config.groups]
    channels = [f'slip/channel/{name}' for name in config.names]
    topics = [*STATES[:2], *groups, *channels]
    left_out = {topics[channel - 1 - len(channels)] for channel in config.disabled_channels}
    types = dict.fromkeys(topics, BOOL) | STAMPED
    types = {f'{namespace}/{topic}': types[topic] for topic in types if topic not in left_out}
    with whole_file(path) as new, new_bag(new, config.names, topics=types) as bag:
        for topic, at_ns, raw in _messages(config, topics, pieces):
            if topic not in left_out:
                bag.put(f'{namespace}/{topic}', at_ns, raw)


def _messages(config: ChainConfig, topics: list[str], pieces: Decided) -> Iterator[Any]:
    """Yield topic, time and bytes of each message."""
    levels = JointStateWriter('', config.names, efforts=True)
    slip_state = JointStateWriter('', STATES)
    before, onset_ns = np.zeros(len(topics), np.bool_), 0
    last_ns: int | None = None

    def states(at_ns: int, state: Bools, every: bool = False) -> Iterator[Any]:
        """Yield the states that have changed, or all of them."""
        nonlocal before, onset_ns
        columns = np.flatnonzero((state != before) | every).tolist()
        if state[0] > before[0]:
            onset_ns = at_ns
            yield 'slip_onset', at_ns, header(at_ns)
        for column in columns:
            yield topics[column], at_ns, BOOLS[int(state[column])]
        if {0, 1} & {*columns}:
            yield (
                'slip_state',
                at_ns,
                slip_state.serialize(at_ns, np.r_[state[:2], onset_ns * 1e-9]),
            )
        before = state

    for samples, result in pieces:
        if samples.new_stretch and last_ns is not None:  # Nothing is decided in a long gap.
            period_ns = round(1e9 / config.sample_rate_hz)
            yield from states(last_ns + period_ns, np.zeros_like(before))
        valid = result.can_vote.any(axis=1)
        rows = np.column_stack([result.slip, valid, result.groups, result.channels])
        level = np.where(result.valid, result.level, np.nan)
        on = result.channels.astype(np.float64)
        for i, at_ns in enumerate(samples.stamps_ns.tolist()):
            yield from states(at_ns, rows[i], every=last_ns is None)
            yield 'slip_detector/envelope', at_ns, levels.serialize(at_ns, level[i], on[i])
            last_ns = at_ns
    if last_ns is not None:  # So that curves reach the end.
        yield from states(last_ns, before, every=True)
