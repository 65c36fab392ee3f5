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

"""Sums up the state of the nodes, in words for the hand's maintainers, on ``/diagnostics``.

Small tasks make one status each, as with ``diagnostic_updater``; the node only ticks.
"""

import math
import time
from collections import Counter, deque
from typing import NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from slip_detector.chain.live_chain import LiveChain, words_of
from slip_detector.chain.samples import Bools, Floats
from slip_detector.chain.stamps import StampGrid
from slip_detector.nodes.inputs import LISTED, Senders
from slip_detector.nodes.messages import event_qos
from slip_detector.nodes.outputs import Outputs
from slip_detector.parameters import name_list

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR

#: Relative error of the measured rate above which there is an error, and the number of summaries,
#: one a second, over which the rate is measured: over one alone a late message would seem as much.
RATE_ERROR, RATE_SUMMARIES = 0.02, 3

#: Smallest share of bridged rows, and relative error of the usual step from stamp to stamp, that
#: show that no samples are lost but the rate is another one.
STEADY_SHARE, STEADY_ERROR = 0.05, 0.1

#: Time in seconds for which a detector that has heard nothing yet only warns of it: the sensor's
#: publisher has to find the detector.
PATIENCE_S = 3.0

#: Age of a sample in seconds, either way, from which on a warning is given.
AGE_WARNING_S = 1.0

#: By event, how bad it is and what is said of those since the last summary; the placeholder is
#: their number. The errors are of samples that come and are dropped.
EVENTS = {
    'lost and bridged': (WARN, '{} samples lost and bridged: check cable, network, load'),
    'restarts': (WARN, 'restarted {} times: a long gap, or the clock of the samples was set'),
    'dropped, late': (
        WARN, '{} samples dropped: late, or with a stamp that does not fit the others'
    ),
    'taken, stamp too late': (
        WARN, '{} samples taken in their order: the stamp is later than it can be'
    ),
    'dropped, wrong number of channels': (
        ERROR, '{} samples dropped: not as many channels as configured'
    ),
    'dropped, wrong names': (
        ERROR, '{} samples dropped: other channel names than before or configured'
    ),
    'dropped, no such field': (ERROR, '{} samples dropped: input_field is not in them'),
    'dropped, of several senders': (ERROR, '{} samples dropped: of several senders'),
}  # fmt: skip

#: Keys of the values on the age of the samples when the decision is published.
AGE_KEYS = ('age of the samples, median [ms]', 'age of the samples, 99 % below [ms]')

#: Likely causes of a channel at the end of its range.
AT_RAIL = 'unplugged, broken or overloaded?'


def make_status(
    name: str, all_well: str, complaints: list[tuple[bytes, str]], values: dict[str, str]
) -> DiagnosticStatus:
    """Return one line of the diagnostics.

    Parameters
    ----------
    name
        The part of the node that it describes.
    all_well
        The message if nothing is wrong.
    complaints
        Level and description of everything that is wrong.
    values
        Details, by key.
    """
    worst_first = sorted(complaints, key=lambda complaint: complaint[0], reverse=True)
    return DiagnosticStatus(
        name=name,
        level=max((level for level, _ in complaints), default=OK),
        message='; '.join(words for _, words in worst_first) or all_well,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


class Note(NamedTuple):
    """Rows that have been through the chain: volts and which are valid, shape (n, channels)."""

    rows: Floats
    valid: Bools
    #: Stamp of the last row, and the time from that to the decision, by the node's clock.
    stamp_ns: int
    age_s: float
    #: Time that the node spent on the rows.
    spent_s: float


class Health:
    """Collects observations of the rows, and sums them up in small tasks once a second.

    Rows are only collected when they come; the statistics are computed in the summary. What chain
    and outputs know they are asked then.
    """

    #: Who sends samples, and who publishes slip.
    senders: Senders
    detectors: Senders

    def __init__(self, chain: LiveChain, outputs: Outputs) -> None:
        self._chain, self._outputs = chain, outputs
        #: Counts since the start, by kind of event.
        self.totals: Counter[str] = Counter()
        self._totals_before: Counter[str] = Counter()
        self._summed_s = time.monotonic()

    def forget(self, stamps: StampGrid) -> None:
        """Forget the rows, as others follow, with stamps on this grid."""
        self._stamps = stamps
        self._noted_s, self._begun_s = -math.inf, time.monotonic()
        self._notes: list[Note] = []
        self.restart()

    def restart(self) -> None:
        """Measure the rate from the next sample on, as the stamps have jumped."""
        # Stamp, and number of rows so far: of the first note and of the last ones before the
        # latest summaries; the rate is measured from the first of these to the last note of all.
        self._points = deque[tuple[int, int]](maxlen=RATE_SUMMARIES)

    def note(self, note: Note) -> None:
        """Note rows that have been through the chain."""
        self._notes.append(note)
        self._noted_s = time.monotonic()
        self.totals['rows'] += len(note.rows)
        self._last_point = note.stamp_ns, self.totals['rows']
        if not self._points:
            self._points.append(self._last_point)

    def summary(self) -> list[DiagnosticStatus]:
        """Sum up the time since the last summary, in one status for each task."""
        now_s = time.monotonic()
        self.totals['taken, stamp too late'] = self._stamps.wrong
        since = self.totals - self._totals_before
        tasks = [
            self._check_input(since, now_s - self._noted_s),
            self._check_timing(since),
            self._check_channels(),
            self._check_decisions(since['rows'], now_s - self._summed_s),
        ]
        if math.isinf(self._noted_s) and now_s - self._begun_s < PATIENCE_S:
            for each in tasks:
                each.level = min(each.level, WARN)
        self._totals_before, self._summed_s, self._notes = self.totals.copy(), now_s, []
        if self._points:
            self._points.append(self._last_point)
        return tasks

    def _check_input(self, since: Counter[str], silent_s: float) -> DiagnosticStatus:
        """Say whether samples come, and what was lost of them."""
        complaints = [
            (level, words.format(since[event]))
            for event, (level, words) in EVENTS.items()
            if since[event]
        ]
        if words := self.senders.complaint():
            complaints.append((ERROR, words))
        elif ERROR in dict(complaints):
            pass  # Samples come.
        elif math.isinf(silent_s):
            words = 'no samples yet: does the sensor run, on this topic, with this type?'
            complaints.append((ERROR, words))
        elif silent_s > self._chain.config.input_timeout_s:
            words = 'is the sensor plugged in, does its driver run?'
            complaints.append((ERROR, f'no samples for {silent_s:.1f} s: {words}'))
        values = {event: str(self.totals[event]) for event in EVENTS}
        values['samples'] = str(self.totals['rows'])
        all_well = f'{since["rows"]} samples since the last report'
        return make_status('input', all_well, complaints, values)

    def _check_timing(self, since: Counter[str]) -> DiagnosticStatus:
        """Say whether rate, age and stamps are as they should be."""
        config, complaints = self._chain.config, []
        wanted_hz, rate_hz = config.sample_rate_hz, self._measured_hz(since)
        all_well, off = f'{rate_hz:.1f} samples a second', abs(rate_hz / wanted_hz - 1.0)
        if off > RATE_ERROR:
            words = f'{wanted_hz:g} configured: the filters are off by the same {100 * off:.0f} %'
            complaints.append((ERROR, f'{all_well}, {words}'))
        ages_ms = [note.age_s * 1e3 for note in self._notes]
        usual_ms, most_ms = np.percentile(ages_ms or [math.nan], [50, 99])
        if abs(usual_ms) > 1e3 * (config.max_age_s or AGE_WARNING_S):
            where = 'behind' if usual_ms > 0 else 'ahead of'
            words = f'stamps are {abs(usual_ms) / 1e3:.1f} s {where} the clock'
            complaints.append((ERROR if config.max_age_s else WARN, words))
        if (stamps := self._stamps.kind) != 'regular':
            words = f'stamps are {stamps}: rows are counted, and lost ones are not found'
            complaints.append((WARN, words))
        values = {
            'configured rate [Hz]': f'{wanted_hz:g}',
            'measured rate [Hz]': _number(rate_hz, '.2f'),
            AGE_KEYS[0]: _number(usual_ms),
            AGE_KEYS[1]: _number(most_ms),
            'stamps': stamps,
        }
        all_well = 'no samples' if math.isnan(rate_hz) else all_well
        return make_status('timing', all_well, complaints, values)

    def _measured_hz(self, since: Counter[str]) -> float:
        """Return the rate by the stamps; NaN where too few samples have come."""
        if not self._points or self._points[0] == self._last_point:
            return math.nan
        (begin_ns, before), (end_ns, rows) = self._points[0], self._last_point
        # Replayed samples without stamps may have the same one.
        rate_hz = (rows - before) * 1e9 / max(end_ns - begin_ns, 1)
        if len(self._notes) > 1 and since['lost and bridged'] > STEADY_SHARE * since['rows']:
            # By the usual step from stamp to stamp, which no lost sample changes.
            steps_ns = np.diff([note.stamp_ns for note in self._notes])
            usual_rows = np.median([len(note.rows) for note in self._notes])
            usual_hz = float(1e9 * usual_rows / max(np.median(steps_ns), 1.0))
            if abs(usual_hz / self._chain.config.sample_rate_hz - 1) > STEADY_ERROR:
                return usual_hz
        return rate_hz

    def _check_channels(self) -> DiagnosticStatus:
        """Say which channels give nothing, and why."""
        config = self._chain.config
        if not self._notes:
            words = 'without samples nothing is known of the channels'
            return make_status('channels', '', [(ERROR, words)], {})
        rows = np.concatenate([note.rows for note in self._notes])
        valid = np.concatenate([note.valid for note in self._notes])
        low, high = config.valid_range_v
        # By fault, the values that have it, and likely causes.
        faults = {
            'not a number': (~np.isfinite(rows), 'the sensor or its driver sends no value'),
            'at the lower rail': (rows <= low, AT_RAIL),
            'at the upper rail': (rows >= high, AT_RAIL),
        }
        others = np.any([mask for mask, _ in faults.values()], axis=0)
        faults['flat'] = (~(valid | others), 'repeats one value, broken?')
        disabled = np.isin(np.arange(1, config.channels + 1), config.disabled_channels)
        n_enabled = int(np.sum(~disabled))
        complaints, values = [], {}
        for fault, (mask, cause) in faults.items():
            names = np.compress(mask.any(axis=0) & ~disabled, config.names).tolist()
            values[fault] = ', '.join(names) or '-'
            if names:
                words = f'{fault}: {name_list(names, LISTED)}: {cause}'
                complaints.append((ERROR if len(names) == n_enabled else WARN, words))
        values['valid now'] = f'{int(valid[-1].sum())} of {n_enabled}'
        values['disabled'] = ', '.join(np.compress(disabled, config.names)) or '-'
        return make_status('channels', f'all {n_enabled} channels are valid', complaints, values)

    def _check_decisions(self, n_rows: int, passed_s: float) -> DiagnosticStatus:
        """Say whether decisions mean something, and what they cost."""
        outputs, names = self._outputs, self._chain.config.names
        complaints = [(WARN, words) for words in words_of(self._chain.look(), names)]
        if words := self.detectors.complaint():
            complaints.append((ERROR, words))
        if not outputs.valid:
            complaints.append((ERROR, 'slip_valid is false: slip has no meaning'))
        spent_ms = 1e3 * sum(note.spent_s for note in self._notes)
        values = {
            'onsets': str(outputs.onsets),
            'time per row [ms]': _number(spent_ms / max(n_rows, 1)),
            'share of the time [%]': _number(spent_ms / (passed_s * 10), '.1f'),
        }
        return make_status(
            'decisions', f'slip is {"ON" if outputs.slip else "OFF"}', complaints, values
        )


def _number(value: float, how: str = '.3f') -> str:
    return '-' if math.isnan(value) else format(value, how)


class Diagnostics:
    """Publishes the statuses of a node, named ``<node>: <part>``."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', event_qos())
        self._name = node.get_fully_qualified_name().lstrip('/')

    def destroy(self) -> None:
        """Destroy the publisher."""
        self._node.destroy_publisher(self._publisher)

    def publish(self, statuses: list[DiagnosticStatus], hardware: str) -> None:
        """Publish statuses of parts of the node, stamped with the current time."""
        for each in statuses:
            each.name, each.hardware_id = f'{self._name}: {each.name}', hardware
        array = DiagnosticArray(status=statuses)
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)
