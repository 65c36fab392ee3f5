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

import time
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.parameter_panel import ParameterPanel
from slip_detector.view.taxels import drawn_positions
from slip_detector.view.track import LiveTrack, Spectrum, spectrum

#: Missing heartbeats after which a detector counts as ended or hung.
SILENT_BEATS = 3.0

#: Characters of a page's name that are kept with a change: a page may send any name.
LONGEST_NAME = 64

#: Time, in seconds, for which the page mentions that a detector was started again.
RESTART_SHOWN_S = 600.0


class Diagnosis(NamedTuple):
    """One line of a detector's diagnostics; level 0 is OK, 1 a warning, 2 an error.

    Examples
    --------
    >>> Diagnosis(1, 'input', '3 samples lost').message
    '3 samples lost'
    """

    level: int
    name: str
    message: str


@dataclass
class Finger:
    """One detector: its parameters, its present state, and its data of the last minute.

    Times are those of :func:`time.monotonic`.

    Examples
    --------
    >>> finger = Finger('/index/slip_detector', DetectorConfig())
    >>> finger.label, finger.config.threshold, finger.slip
    ('index', 0.5, False)
    """

    #: Full name of the detector's node.
    name: str
    config: DetectorConfig
    #: Number of starts of the detector that this process has noticed.
    starts: int = 1
    slip: bool = False
    valid: bool = False
    #: Time of the last onset; None before the first.
    onset_s: float | None = None
    #: Time of the last sample, and of the last message of the detector.
    sample_s: float = float('-inf')
    heard_s: float = field(default_factory=time.monotonic)
    frame_id: str = ''
    diagnostics: tuple[Diagnosis, ...] = ()
    #: Spectra of all channels at rest, kept for comparison.
    rest: Spectrum | None = None
    #: Why no volts are shown; empty if they are.
    no_volts: str = ''

    def __post_init__(self) -> None:
        self.groups: NDArray[np.bool_] = np.zeros(len(self.config.groups), np.bool_)
        self.track = LiveTrack(self.config)
        # After a restart the parameters may be read before the first message, which reveals it.
        self._channels_at_start = self.config.channels
        self._restart, self._restart_s = '', float('-inf')

    @property
    def label(self) -> str:
        """The namespace, and the node's name if it differs from ``slip_detector``.

        Without a namespace it is the node's name.
        """
        namespace, _, node = self.name.strip('/').rpartition('/')
        return '/'.join(filter(None, (namespace, '' if node == 'slip_detector' else node))) or node

    @property
    def notice(self) -> str:
        """What the user should know beside the detector's state; empty if nothing.

        A restart, perhaps with other channels, is mentioned for some minutes.
        """
        recent = time.monotonic() - self._restart_s < RESTART_SHOWN_S
        return '; '.join(filter(None, (self.no_volts, self._restart if recent else '')))

    def update_config(self, config: DetectorConfig) -> None:
        """Note new parameters of the detector; data that fits them is kept.

        Another number of channels, or another rate, begins a new track and drops the spectra at
        rest.
        """
        before, self.config = self.config, config
        if (config.channels, config.sample_rate_hz) != (before.channels, before.sample_rate_hz):
            beginnings = self.track.beginnings
            self.track = LiveTrack(config)
            self.track.beginnings = beginnings + 1
            self.rest = None
        if list(config.groups) != list(before.groups):
            self.groups = np.zeros(len(config.groups), np.bool_)

    def started_again(self, config: DetectorConfig) -> None:
        """Note that the detector was started again, with these parameters."""
        channels, before = config.channels, self._channels_at_start
        self._channels_at_start = channels
        self.starts += 1
        self._restart_s = time.monotonic()
        self._restart = f'the detector was started again at {time.strftime("%H:%M:%S")}'
        if channels != before:
            self._restart += f', with {channels} channels instead of {before}'
        self.update_config(config)
        self.slip = self.valid = False
        self.groups[:] = False
        self.onset_s = None

    def hold_rest(self) -> None:
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


class Detectors(ABC):
    """A registry of the detectors that run, and the requests to them.

    Attributes
    ----------
    fingers : dict
        Each :class:`Finger` by its name.
    gone : dict
        Labels, by name, of fingers whose detectors have ended, until they come back.
    panels : dict
        The :class:`ParameterPanel` of each detector by its name, also of one that has ended: its
        changes can be set again when it comes back. Subclasses enter what they read, and changes
        that detectors report.
    """

    def __init__(self) -> None:
        self.fingers: dict[str, Finger] = {}
        self.gone: dict[str, str] = {}
        self.panels: dict[str, ParameterPanel] = {}

    @abstractmethod
    def watch(self, names: Collection[str]) -> None:
        """Receive the data of these fingers, and of no others."""

    @abstractmethod
    def poll(self) -> None:
        """Process what has arrived since the last call, without waiting."""

    def panel(self, name: str) -> ParameterPanel:
        """Return the panel of a detector, which is created at the first call."""
        return self.panels.setdefault(name, ParameterPanel())

    async def change(self, name: str, values: Mapping[str, Any], by: str) -> None:
        """Set parameters of a finger's detector, all or none.

        Parameters
        ----------
        name
            The detector.
        values
            By name; None deletes the parameter, such as a group to be removed.
        by
            The page that asks.

        Raises
        ------
        ValueError
            When they are refused, in the words of the detector.
        """
        panel, by = self.panel(name), by[:LONGEST_NAME]
        panel.expect(values, by)
        refusal = 'it could not be asked'
        try:
            refusal = await self.set_parameters(name, values)
        finally:
            if refusal:
                panel.refused(values, by)
        if refusal:
            raise ValueError(refusal)

    @abstractmethod
    async def set_parameters(self, name: str, values: Mapping[str, Any]) -> str:
        """Set parameters of a finger's detector, all or none; return the refusal, or ''."""

    @abstractmethod
    def close(self) -> None:
        """Release all resources."""


def finger_description(finger: Finger) -> dict[str, Any]:
    """Return the description of a finger: its channels, its groups and its decision.

    Examples
    --------
    >>> finger = Finger('/index/slip_detector', DetectorConfig(channels=2))
    >>> described = finger_description(finger)
    >>> described['label'], described['channels'], described['groups']
    ('index', ['ch1', 'ch2'], {'all': [1, 2]})
    """
    config = finger.config
    return {
        'name': finger.name,
        'label': finger.label,
        'starts': finger.starts,
        'notice': finger.notice,
        'channels': list(config.names),
        'positions_m': drawn_positions(config).tolist(),
        'disabled': list(config.disabled_channels),
        'groups': {name: list(members) for name, members in config.groups.items()},
        'vote': config.vote,
        'decision': config.decision,
        'threshold': config.threshold,
        'sample_rate_hz': config.sample_rate_hz,
        'input_timeout_s': config.input_timeout_s,
        'passband_hz': list(config.passband_hz),
        'stopbands_hz': [list(pair) for pair in config.stopbands_hz],
        'mains_hz': config.mains_hz,
    }
