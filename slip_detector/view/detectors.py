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


"""The detectors as the live page knows them, independent of ROS: one for each finger."""

import functools
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.distance import pdist

from slip_detector.chain.samples import Bools, Floats
from slip_detector.parameters import FIXED_PARAMETERS, DetectorConfig, quote
from slip_detector.view.track import LiveTrack, Spectrum, spectrum

#: Missing heartbeats after which a detector counts as ended or hung.
SILENT_BEATS = 3.0

#: Time, in seconds, for which the page mentions that a detector was started again.
RESTART_SHOWN_S = 600.0

#: How many changes of parameters can be undone, and how many a page lists.
MOST_CHANGES, LISTED_CHANGES = 1000, 8

#: Authors of changes that no page asked for: another program, or a restart of the detector.
OUTSIDE, RESTART = 'outside', 'restart'

#: Parameters by name, as ROS has them.
Values = dict[str, Any]

#: Parameters that every page needs.
PAGE_PARAMETERS = (
    'groups', 'vote', 'decision', 'threshold', 'sample_rate_hz', 'input_timeout_s', 'passband_hz',
    'stopbands_hz', 'mains_hz', 'evidence_limit_db_s',
)  # fmt: skip

#: Pitch of the grid for a finger without taxel positions; the taxels of tactile fingertips are one
#: to seven millimetres apart.
GRID_PITCH_M = 2.5e-3

#: Channels at one position, such as the axes of one taxel, are drawn on a circle around it. Its
#: radius is this share of the least distance between two positions.
CIRCLE_SHARE = 0.25


class Diagnosis(NamedTuple):
    """One line of a detector's diagnostics; level 0 is OK, 1 a warning, 2 an error."""

    level: int
    name: str
    message: str


class Change(NamedTuple):
    """A change of a detector's configuration."""

    before: DetectorConfig
    after: DetectorConfig
    #: The author: a page, or ``OUTSIDE``, or ``RESTART``.
    by: str


@dataclass
class Finger:
    """One detector: its parameters and their changes, its state, its data of the last minute.

    Times are those of :func:`time.monotonic`.

    Examples
    --------
    >>> finger = Finger('/index/slip_detector', DetectorConfig())
    >>> finger.update_config(DetectorConfig(threshold=0.25), by='page 1')
    >>> finger.label, finger.config.threshold, finger.to_undo()
    ('index', 0.25, {'threshold': 0.5})
    """

    #: Full name of the detector's node.
    name: str
    config: DetectorConfig
    slip: bool = False
    valid: bool = False
    #: Time of the last onset; None before the first.
    onset_s: float | None = None
    #: Time of the last sample, and of the last message of the detector.
    sample_s: float = float('-inf')
    #: When samples came last that do not fit the detector, and what is wrong with them.
    unfit: tuple[float, str] = (float('-inf'), '')
    #: The values to set so that the detector takes what comes.
    to_fit: Values = field(default_factory=dict)
    heard_s: float = field(default_factory=time.monotonic)
    frame_id: str = ''
    diagnostics: tuple[Diagnosis, ...] = ()
    #: Spectra of all channels at rest, kept for comparison.
    rest: Spectrum | None = None
    #: Why no volts are shown; empty if they are.
    no_volts: str = ''
    #: Whether the recording that it plays stands still, so that no samples are due.
    paused: bool = False

    def __post_init__(self) -> None:
        self.groups: Bools = np.zeros(len(self.config.groups), np.bool_)
        self.track = LiveTrack(self.config)
        self._restarted_s = float('-inf')  # since 1970
        #: The configuration in the parameter file; without a file, the first one that was read.
        self.in_file = self.config
        #: Changes that can be undone, and the latest changes, undone or not; the newest last.
        self.history: deque[Change] = deque(maxlen=MOST_CHANGES)
        self.changes: deque[Change] = deque(maxlen=LISTED_CHANGES)
        #: Number of changes so far.
        self.count = 0

    @property
    def label(self) -> str:
        """The namespace, and the node's name if it differs from ``slip_detector``.

        Without a namespace it is the node's name.

        Examples
        --------
        >>> names = '/left/index/slip_detector', '/slip_detector', '/index/second', '/second'
        >>> [Finger(name, DetectorConfig()).label for name in names]
        ['left/index', 'slip_detector', 'index/second', 'second']
        """
        namespace, _, node = self.name.strip('/').rpartition('/')
        return '/'.join(filter(None, (namespace, '' if node == 'slip_detector' else node))) or node

    def update_config(self, config: DetectorConfig, by: str = OUTSIDE) -> None:
        """Note the parameters that the detector has now, and who changed them.

        Data that fits them is kept: another number of channels, or another rate, begins a new
        track and drops the spectra at rest. A detector that was started again has the
        configuration of its file. This counts as a change: undoing it restores what had been set
        before the restart.
        """
        before, self.config, self.to_fit = self.config, config, {}
        if by == RESTART:
            self._restarted_s = time.time()
            self.slip = self.valid = False
            self.onset_s = None
        if (config.channels, config.sample_rate_hz) != (before.channels, before.sample_rate_hz):
            self.track = LiveTrack(config, self.track.beginnings + 1)
            self.rest = None
        if by == RESTART or list(config.groups) != list(before.groups):
            self.groups = np.zeros(len(config.groups), np.bool_)
        if config == before:
            return
        change = Change(before, config, by)
        self.changes.append(change)
        self.count += 1
        if by != RESTART and self.history and self.history[-1].before == config:
            self.history.pop()
        else:
            self.history.append(change)

    def to_undo(self) -> Values:
        """Return the values that undo the last change; empty where there is none."""
        wanted = self.history[-1].before if self.history else self.config
        return self.config.changes_to(wanted, FIXED_PARAMETERS)

    def as_in_file(self, kept: Collection[str] = ()) -> Values:
        """Return the values that restore those of the file but for some that are kept."""
        return self.config.changes_to(self.in_file, {*FIXED_PARAMETERS, *kept})

    @property
    def offer(self) -> str:
        """What a button says that makes the detector take what comes; empty: it does."""
        values = {**vars(self.config), **self.to_fit}
        words = 'Take {channels} channels at {sample_rate_hz:g} Hz'.format(**values)
        one_group = ', one group' if 'groups.all' in values else ''
        return f'{words}{one_group}' if self.to_fit else ''

    def keep_rest(self) -> None:
        """Keep the spectra of the last seconds as those at rest.

        Raises
        ------
        ValueError
            When too few samples have come.
        """
        rest = spectrum(self.track.samples.field('volts'), self.config.sample_rate_hz)
        if rest is None:
            raise ValueError(f'{self.label}: too few samples for a spectrum have come')
        self.rest = rest

    def silence(self) -> str:
        """Return a message if the detector has been silent for too long; empty if not."""
        silent_s = time.monotonic() - self.heard_s
        if silent_s < max(1.0, SILENT_BEATS / self.config.heartbeat_hz):
            return ''
        return f'the detector has not been heard for {silent_s:.0f} s: was it killed, or stopped?'

    def description(self) -> dict[str, Any]:
        """Return the channels, the groups and the decision, as a page shows them."""
        config, notices = self.config, [self.no_volts] if self.no_volts else []
        if time.time() - self._restarted_s < RESTART_SHOWN_S:
            at = time.strftime('%H:%M:%S', time.localtime(self._restarted_s))
            notices.append(f'the detector was started again at {at}')
        return {
            'name': self.name,
            'label': self.label,
            'notice': '; '.join(notices),
            'offer': self.offer,
            'channels': config.names,
            'positions_m': drawn_positions(config).tolist(),
            'disabled': config.disabled_channels,
            'activity_hz': config.low_band_hz[1:] if config.activity_cap_db else (),
            **{name: getattr(config, name) for name in PAGE_PARAMETERS},
        }


def drawn_positions(config: DetectorConfig) -> Floats:
    """Return where page and RViz draw the channels of a finger, no two at the same position.

    If ``taxel_positions_m`` is empty, this is a grid about as wide as high, row by row from the
    upper left.

    Returns
    -------
    ndarray, shape (channels, 3)
        Metres in the frame of the samples: x to the right and y upwards on the page.

    Examples
    --------
    >>> drawn_positions(DetectorConfig(channels=4))[:, :2].tolist()
    [[-0.00125, 0.00125], [0.00125, 0.00125], [-0.00125, -0.00125], [0.00125, -0.00125]]
    """
    if config.taxel_positions_m:
        return np.array(_separate(config.taxel_positions_m))
    width = int(np.ceil(np.sqrt(config.channels)))
    row, column = np.divmod(np.arange(config.channels), width)
    grid = [column - (width - 1) / 2, row[-1] / 2 - row, np.zeros(config.channels)]
    return np.column_stack(grid) * GRID_PITCH_M


def least_distance_m(positions: Floats) -> float:
    """Return the distance of the two closest positions; for a single one, the pitch of the grid.

    Parameters
    ----------
    positions : ndarray, shape (n, 3)
        All different.

    Examples
    --------
    >>> least_distance_m(np.array([[0.0, 0.0, 0.0], [0.003, 0.004, 0.0], [0.01, 0.0, 0.0]]))
    0.005
    """
    if len(positions) == 1:
        return GRID_PITCH_M
    return float(pdist(positions).min())


@functools.lru_cache(maxsize=32)  # Called at each tick of the server.
def _separate(taxel_positions_m: tuple[float, ...]) -> Floats:
    """Return the positions; those that coincide are moved onto a circle around them."""
    positions = np.reshape(taxel_positions_m, (-1, 3))
    places, counts = np.unique(positions, axis=0, return_counts=True)
    for place in places[counts > 1]:
        sharing = np.flatnonzero((positions == place).all(axis=1))
        # Clockwise from the left, so that the x, y and z of a taxel stand in reading order.
        angle = np.pi - 2 * np.pi * np.arange(len(sharing)) / len(sharing)
        circle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
        positions[sharing] += CIRCLE_SHARE * least_distance_m(places) * circle
    return positions


class Detectors(ABC):
    """A registry of the detectors that run, and the requests to them."""

    def __init__(self) -> None:
        #: Each finger by its name.
        self.fingers: dict[str, Finger] = {}
        #: Fingers whose detectors have ended, by name, until they come back: what had been set can
        #: be set again then.
        self.gone: dict[str, Finger] = {}

    @abstractmethod
    def watch(self, names: Collection[str]) -> None:
        """Receive the data of these fingers, and of no others."""

    @abstractmethod
    def poll(self) -> None:
        """Process what has arrived since the last call, without waiting."""

    def note_config(self, name: str, config: DetectorConfig, by: str) -> None:
        """Note the configuration that a detector has now, and who changed it."""
        finger = self.fingers.get(name) or self.gone.pop(name, None)
        if finger is not None:
            finger.update_config(config, by)
        self.fingers[name] = finger or Finger(name, config)

    def order(self, name: str, what: str = '') -> bool:
        """Tell a simulated finger what to do, '': nothing; return whether it is one that obeys."""
        return False

    def with_gone(self) -> dict[str, Finger]:
        """Return all fingers by name, also those whose detectors have ended."""
        return {**self.gone, **self.fingers}

    def finger_of(self, name: str | None) -> Finger:
        """Return a finger, also one whose detector has ended; a ValueError if there is none."""
        finger = self.with_gone().get(name or '')
        if finger is None:
            raise ValueError(f'there is no finger {quote(name)}')
        return finger

    @abstractmethod
    async def change(self, name: str, values: Mapping[str, Any], by: str) -> None:
        """Set parameters of a finger's detector, all or none; None deletes one.

        When it returns, the finger has the new values, changed by this page.

        Raises
        ------
        ValueError
            When they are refused, in the words of the detector.
        """
