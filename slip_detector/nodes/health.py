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

"""Sums up the state of the nodes, in words for the hand's maintainers, on ``/diagnostics``."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from numpy.typing import NDArray
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.fields import listed

#: Relative errors of the measured rate above which there is a warning, and an error.
RATE_WARNING, RATE_ERROR = 0.02, 0.05

#: Shares of the time spent on rows above which there is a warning, and an error.
LOAD_WARNING, LOAD_ERROR = 0.5, 0.9

#: Most names that are listed; of further ones only the number is given.
LISTED = 8


class Level(IntEnum):
    """The levels of ``diagnostic_msgs/DiagnosticStatus``.

    Examples
    --------
    >>> max(Level.OK, Level.WARN)
    <Level.WARN: 1>
    """

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass
class Status:
    """One line of the diagnostics.

    Examples
    --------
    >>> status = Status('input', all_well='380.0 samples a second')
    >>> status.complain(Level.WARN, '3 samples lost')
    >>> status.level, status.message
    (<Level.WARN: 1>, '3 samples lost')
    """

    name: str
    level: Level = Level.OK
    #: Severity and description of everything that is wrong.
    complaints: list[tuple[Level, str]] = field(default_factory=list)
    values: dict[str, str] = field(default_factory=dict)
    #: The message if nothing is wrong.
    all_well: str = ''

    def complain(self, level: Level, words: str) -> None:
        """Add something that is wrong."""
        self.complaints.append((level, words))
        self.level = max(self.level, level)

    @property
    def message(self) -> str:
        """What is wrong in one line, the worst first, or ``all_well``."""
        worst_first = sorted(self.complaints, key=lambda complaint: -complaint[0])
        return '; '.join(words for _, words in worst_first) or self.all_well


class Health:
    """Collects observations of the rows, and sums them up on request.

    Rows are only collected when they come; the statistics are computed in the summary.

    Parameters
    ----------
    config
        The detector's parameters, which describe the expected input.

    Examples
    --------
    >>> health, rows = Health(DetectorConfig()), np.full((2, 16), 4.3)
    >>> for second in range(2):
    ...     health.note_rows(rows, rows > 0.0, second * 10**9, age_s=0.001, spent_s=0.0002)
    >>> input_status, *_ = health.summary(1.0, silent_s=0.0, slip=False, valid=True)
    >>> input_status.message
    '2.0 samples a second, 380 configured: the filters are off by the same 99 %'
    """

    def __init__(self, config: DetectorConfig) -> None:
        self.config = config
        #: The nodes that publish the input, and those that publish slip, if there are several.
        self.senders: Sequence[str] = ()
        self.detectors: Sequence[str] = ()
        #: Counts since the start, by kind of event.
        self.totals: Counter[str] = Counter()
        self._totals_before: Counter[str] = Counter()
        self._rows: list[NDArray[np.float64]] = []
        self._valid: list[NDArray[np.bool_]] = []
        # Stamps of the last sample before the present summary's, and of the last sample.
        self._stamp_before_ns: int | None = None
        self._stamp_ns: int | None = None
        self._rows_between = 0
        self._spent_s = self._longest_s = 0.0
        self._ages_s: list[float] = []

    def configure(self, config: DetectorConfig) -> None:
        """Take another configuration; if the number of channels changes, rows are dropped."""
        if config.channels != self.config.channels:
            self._rows, self._valid = [], []
        self.config = config

    def note_rows(
        self,
        rows: NDArray[np.float64],
        valid: NDArray[np.bool_],
        stamp_ns: int,
        age_s: float,
        spent_s: float,
    ) -> None:
        """Note rows that have been through the chain.

        Parameters
        ----------
        rows, valid : ndarray, shape (n, channels)
            Volts, and whether each of them is valid.
        stamp_ns
            Stamp of the last row.
        age_s
            Time from that stamp to the decision, by the node's clock.
        spent_s
            Time that the node spent on these rows.
        """
        self._rows.append(rows)
        self._valid.append(valid)
        self.totals['rows'] += len(rows)
        if self._stamp_before_ns is None:
            self._stamp_before_ns = stamp_ns
        else:
            self._rows_between += len(rows)
        self._stamp_ns = stamp_ns
        self._ages_s.append(age_s)
        self._spent_s += spent_s
        self._longest_s = max(self._longest_s, spent_s)

    def restart(self) -> None:
        """Measure the rate from the next sample on, as the stamps have jumped."""
        self._stamp_before_ns = self._stamp_ns = None
        self._rows_between = 0

    def summary(
        self, passed_s: float, *, silent_s: float, slip: bool, valid: bool
    ) -> list[Status]:
        """Sum up the time since the last summary.

        Parameters
        ----------
        passed_s
            Time since the last summary.
        silent_s
            Time since the last row; infinite before the first row.
        slip, valid
            The present states of ``slip`` and ``slip_valid``.

        Returns
        -------
        list of Status
            Of the input, the channels and the decisions.
        """
        since = self.totals - self._totals_before
        statuses = [
            self._input(since, silent_s),
            self._channels(),
            self._decisions(since, passed_s, slip, valid),
        ]
        self._totals_before = self.totals.copy()
        self._rows, self._valid = [], []
        self._stamp_before_ns, self._rows_between = self._stamp_ns, 0
        self._spent_s = self._longest_s = 0.0
        self._ages_s = []
        return statuses

    def rate_hz(self) -> float | None:
        """Return the rate of the rows since the last summary, by their stamps; None if unknown."""
        if self._stamp_ns is None or self._stamp_before_ns is None or not self._rows_between:
            return None
        return self._rows_between * 1e9 / (self._stamp_ns - self._stamp_before_ns)

    def _input(self, since: Counter[str], silent_s: float) -> Status:
        config = self.config
        status = Status('input')
        wanted_hz, rate_hz = config.sample_rate_hz, self.rate_hz()
        if self.senders:
            status.complain(
                Level.ERROR,
                f'the input is published by {listed(self.senders, LISTED)}: only one of them may',
            )
        elif math.isinf(silent_s):
            status.complain(
                Level.ERROR, 'no samples yet: does the sensor run, on this topic, with this type?'
            )
        elif silent_s > config.input_timeout_s:
            status.complain(
                Level.ERROR,
                f'no samples for {silent_s:.1f} s: is the sensor plugged in, does its driver run?',
            )
        elif rate_hz is not None:
            off = abs(rate_hz / wanted_hz - 1.0)
            level = Level.ERROR if off > RATE_ERROR else Level.WARN
            if off > RATE_WARNING:
                status.complain(
                    level,
                    f'{rate_hz:.1f} samples a second, {wanted_hz:g} configured: the filters are '
                    f'off by the same {100 * off:.0f} %',
                )
            status.all_well = f'{rate_hz:.1f} samples a second'
        for kind, words in COMPLAINTS.items():
            if since[kind]:
                level = Level.ERROR if kind in ('channels', 'names', 'field') else Level.WARN
                status.complain(level, words.format(since[kind]))
        status.values = {
            'configured rate [Hz]': f'{wanted_hz:g}',
            'measured rate [Hz]': _number(rate_hz, '.2f'),
            AGE_KEYS[0]: _milliseconds(self._ages_s, 50),
            AGE_KEYS[1]: _milliseconds(self._ages_s, 99),
            'silent for [s]': '-' if math.isinf(silent_s) else f'{silent_s:.1f}',
            'samples': str(self.totals['rows']),
            **{COUNT_KEYS[kind]: str(self.totals[kind]) for kind in COUNT_KEYS},
        }
        return status

    def _channels(self) -> Status:
        config = self.config
        disabled = {channel - 1 for channel in config.disabled_channels}
        status = Status('channels')
        n_enabled = config.channels - len(disabled)
        if not self._rows:
            status.complain(Level.ERROR, 'without samples nothing is known of the channels')
            return status
        rows, valid = np.concatenate(self._rows), np.concatenate(self._valid)
        low, high = config.valid_range_v
        kinds = {
            'not a number': ~np.isfinite(rows),
            'at the lower rail': rows <= low,
            'at the upper rail': rows >= high,
        }
        bad = np.zeros(rows.shape, np.bool_)
        for mask in kinds.values():
            bad |= mask
        kinds['flat'] = ~valid & ~bad
        for kind, mask in kinds.items():
            names = [
                config.names[c] for c in np.flatnonzero(mask.any(axis=0)) if int(c) not in disabled
            ]
            status.values[kind] = ', '.join(names) or '-'
            if names:
                level = Level.ERROR if len(names) == n_enabled else Level.WARN
                status.complain(level, f'{kind}: {listed(names, LISTED)}: {ADVICE[kind]}')
        now_valid = int(valid[-1].sum())
        status.values['valid now'] = f'{now_valid} of {n_enabled}'
        status.values['disabled'] = ', '.join(config.names[c] for c in sorted(disabled)) or '-'
        status.all_well = f'all {n_enabled} channels are valid'
        return status

    def _decisions(self, since: Counter[str], passed_s: float, slip: bool, valid: bool) -> Status:
        status = Status('decisions')
        rows = sum(len(rows) for rows in self._rows)
        load = self._spent_s / passed_s if passed_s > 0 else 0.0
        if self.detectors:
            who = listed(self.detectors, LISTED)
            status.complain(Level.ERROR, f'slip is published by {who}: only one of them may')
        if not valid:
            status.complain(Level.ERROR, 'slip_valid is false: slip has no meaning')
        if load > LOAD_WARNING:
            level = Level.ERROR if load > LOAD_ERROR else Level.WARN
            status.complain(
                level, f'rows take {100 * load:.0f} % of the time: the machine is too slow or busy'
            )
        status.values = {
            'slip': 'ON' if slip else 'OFF',
            'slip_valid': 'true' if valid else 'false',
            'onsets': str(self.totals['onsets']),
            'onsets since the last report': str(since['onsets']),
            'time per row [ms]': _number(self._spent_s / rows * 1e3 if rows else None, '.3f'),
            'longest [ms]': _number(self._longest_s * 1e3 if rows else None, '.3f'),
            'share of the time [%]': f'{100 * load:.1f}',
        }
        status.all_well = f'slip is {"ON" if slip else "OFF"}'
        return status


#: Messages on events since the last summary, by kind of event; the placeholder is their number.
COMPLAINTS: Mapping[str, str] = {
    'bridged': '{} samples lost and bridged with the last one: check cable, network, load',
    'reset': 'restarted {} times: a long gap, or the clock of the samples was set',
    'backwards': '{} samples dropped: late, or stamped before the ones already seen',
    'channels': '{} samples dropped: not as many channels as configured',
    'names': '{} samples dropped: other channel names than before or configured',
    'field': '{} samples dropped: input_field is not in them',
}

#: Keys of the counts in the values of the input's status, by kind of event.
COUNT_KEYS: Mapping[str, str] = {
    'bridged': 'lost and bridged',
    'reset': 'restarts',
    'backwards': 'dropped, late',
    'channels': 'dropped, wrong number of channels',
    'names': 'dropped, wrong names',
    'field': 'dropped, no such field',
    'senders': 'dropped, of several senders',
}

#: Keys of the values on the age of the samples when the decision is published.
AGE_KEYS = ('age of the samples, median [ms]', 'age of the samples, 99 % below [ms]')

#: Likely causes of a fault of a channel, by kind of fault.
ADVICE: Mapping[str, str] = {
    'not a number': 'the sensor or its driver sends no value',
    'at the lower rail': 'unplugged, broken or overloaded?',
    'at the upper rail': 'unplugged, broken or overloaded?',
    'flat': 'repeats one value, broken?',
}


def _milliseconds(times_s: list[float], percentile: float) -> str:
    return f'{np.percentile(times_s, percentile) * 1e3:.3f}' if times_s else '-'


def _number(value: float | None, how: str) -> str:
    return '-' if value is None else format(value, how)


class Diagnostics:
    """Publishes the statuses of a node, named ``<node>: <part>``."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(
            DiagnosticArray,
            '/diagnostics',
            10,
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
        )
        self._name = node.get_fully_qualified_name().lstrip('/')

    def destroy(self) -> None:
        """Destroy the publisher."""
        self._node.destroy_publisher(self._publisher)

    def publish(self, statuses: list[Status], hardware: str) -> None:
        """Publish all statuses, stamped with the current time."""
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        for status in statuses:
            array.status.append(
                DiagnosticStatus(
                    level=bytes([status.level]),
                    name=f'{self._name}: {status.name}',
                    message=status.message,
                    hardware_id=hardware,
                    values=[KeyValue(key=key, value=text) for key, text in status.values.items()],
                )
            )
        self._publisher.publish(array)
