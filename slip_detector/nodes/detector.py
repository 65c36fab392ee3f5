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

"""The detector node: receives samples and publishes slip."""

import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from std_msgs.msg import Bool

from slip_detector.chain.live_chain import HISTORY_S, INPUT_PARAMETERS, LiveChain
from slip_detector.chain.samples import Floats
from slip_detector.chain.slip_chain import check_memory
from slip_detector.chain.stamp_rules import DROPPED
from slip_detector.chain.stamps import StampGrid
from slip_detector.nodes.health import Diagnostics, Health, Note
from slip_detector.nodes.inputs import Input, Senders, find_publishing_nodes
from slip_detector.nodes.messages import STEADY, sensor_qos
from slip_detector.nodes.outputs import Outputs
from slip_detector.nodes.parameters import declare, follow_changes
from slip_detector.nodes.rclpy_internals import ROS_ERRORS, destroy_state_machine
from slip_detector.parameters import FIXED_PARAMETERS, DetectorConfig, name_list

#: Number of checks of the input within ``input_timeout_s``, and the share of the timeout after
#: which it counts as lost, from the last check that found a sample. That is between 0.75 and 0.95
#: of the timeout after the last sample, as it is checked before each heartbeat too.
CHECKS, LOST_AFTER = 10, 0.75

#: Longest time, in seconds, until a chain that was built is used, until a failed subscription is
#: tried again, and until the node listens once slip has a subscriber.
SWAP_S = 0.1

#: Longest time, in seconds, for which a subscriber to slip is waited for before the node listens.
LISTEN_S = 1.0

#: Shortest time, in seconds, for which several publishers of a topic count as sending after they
#: were heard in turns.
SEVERAL_S = 1.0

#: Period of the reports in seconds, and shortest time between two log messages of an event.
REPORT_S = LOG_S = 1.0

#: Longest time between two heartbeats, in seconds, for which the node waits: that of the lowest
#: ``heartbeat_hz``. A publisher that offers no deadline counts as one with this heartbeat.
SLOWEST_S = 20.0

#: Most channel names in a log message.
NAMES = 4

SUCCESS, FAILED = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.ERROR


def _logged(transition: Callable[..., Any]) -> Callable[..., Any]:
    """Log the error of a failed transition: rclpy drops the exception."""

    def run(self: 'Detector', state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return transition(self, state)
        except Exception as error:
            self.get_logger().error(f'the {transition.__name__} failed: {error!r}')
            return FAILED

    return run


class Detector(LifecycleNode):
    """Runs the chain on each sample and publishes decisions that change.

    It is a managed node: *configure* builds the chain and the topics, *activate* subscribes to the
    input. While inactive, it publishes nothing and has no subscription and no timer.

    All its callbacks run in one thread; only chains are built in another.

    Parameters
    ----------
    cli_args
        ROS arguments for this node, which override those of the process.
    """

    def __init__(self, cli_args: list[str] | None = None) -> None:
        super().__init__('slip_detector', allow_undeclared_parameters=True, cli_args=cli_args)
        # The configuration that was set last; it is active once its filters are built.
        self.requested = declare(self, DetectorConfig, FIXED_PARAMETERS, cli_args)
        self._check(self.requested)
        self._warn(self.requested.remarks())
        follow_changes(self, lambda: self.requested, self._check, self._apply)
        self._configured = False
        self._samples: Subscription | None = None
        # The node is active while it has timers, here by period and callback.
        self._running: dict[tuple[float, Callable[[], None]], Timer] = {}
        if self.requested.autostart:
            for trigger in (self.trigger_configure, self.trigger_activate):
                if trigger() is not SUCCESS:
                    raise ValueError('the node cannot be started')

    # The life of the node.

    @_logged
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Build the chain and the topics."""
        self._active = config = self.requested
        self._chain = LiveChain(config)
        self._outputs = Outputs(self, config)
        self._health = Health(self._chain, self._outputs)
        self._logged_s: dict[str, float] = {}  # By event.
        self._configured = True
        count, groups = config.channels - len(config.disabled_channels), ', '.join(config.groups)
        words = f'{count} channels at {config.sample_rate_hz:g} Hz, groups {groups}'
        self.get_logger().info(words)
        return SUCCESS

    @_logged
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe to the input."""
        self._chain.reset()
        self._forget_input()
        self._diagnostics = Diagnostics(self)
        # Whether a sample has come since the last check, for how long none had come by then, and
        # the time of the last check. The timeout begins with the first check.
        self._heard, self._silent_ns, self._now_ns = True, 0, 0
        # By the machine's clock: the last check, and when the clock of the timeout last moved.
        self._checked_ns = self._moved_ns = time.monotonic_ns()
        # When the last message came, by the machine's clock; when it was sent, by the sender's;
        # and the sending times of the messages that waited while this node was held up.
        self._came_ns, self._sent_ns, self._waiting_ns = 0, 0, range(0)
        self._listen_s = time.monotonic() + LISTEN_S
        self._health.senders = self._senders = Senders(
            lambda: max(SEVERAL_S, self._active.input_timeout_s),
            'the input',
            lambda: find_publishing_nodes(self, self.resolve_topic_name('voltages')),
        )
        self._start_timers()
        # The heartbeats of all detectors that publish on the same topics, and the longest of their
        # deadlines. One period of the report is added, as the deadlines are read there.
        self._deadline_s = 0.0
        self._heartbeats = self.create_subscription(
            Bool, 'slip_valid', self._on_slip_valid, sensor_qos(), raw=True
        )
        self._health.detectors = self._detectors = Senders(
            lambda: REPORT_S + 1.5 * self._deadline_s,
            'slip',
            lambda: find_publishing_nodes(self, self._heartbeats.topic_name),
        )
        return SUCCESS

    def destroy_node(self) -> None:
        """Withdraw all decisions, then destroy the node and what its life cycle is kept in."""
        if self._running and self.context.ok():
            self._outputs.end()
        super().destroy_node()
        destroy_state_machine(self)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish that slip is not valid, then stop publishing."""
        self._outputs.withdraw()
        self._run_timers()
        self._stop_input()
        self.destroy_subscription(self._heartbeats)
        self._diagnostics.destroy()
        return SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy the topics."""
        self._outputs.destroy()
        self._configured = False
        return SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy everything, from any state."""
        if self._running:
            self.on_deactivate(state)
        if self._configured:
            self.on_cleanup(state)
        return SUCCESS

    on_error = on_shutdown  # After a failed transition the node is unconfigured.

    # Parameters.

    def _check(self, config: DetectorConfig) -> None:
        """Raise a ValueError if a configuration cannot be run."""
        check_memory(config, 2 * HISTORY_S)  # Rows, and rows at rest.
        Input(config)

    def _apply(self, config: DetectorConfig) -> None:
        """Use a new configuration, at once or when its chain is built."""
        known = self.requested.remarks()
        self._warn([words for words in config.remarks() if words not in known])
        self.requested = config
        if self._configured and self._chain.change(config):
            self._swap()

    def _warn(self, remarks: Sequence[str]) -> None:
        for words in remarks:
            self.get_logger().warning(words)

    def _swap(self) -> bool:
        """Use the new chain from the next row on, if it is ready; return whether it was."""
        if not self._chain.swap():
            return False
        before, config = self._active, self._chain.config
        self._active = config
        differ = {name for name in vars(config) if getattr(config, name) != getattr(before, name)}
        self._outputs.configure(config)
        if not self._running:
            return True
        if differ & {'input_type', 'input_field'}:
            self._stop_input()
        if differ & {*INPUT_PARAMETERS, 'channel_names'}:
            self._forget_input()
        self._stamp_grid.max_gap_s = config.max_gap_s
        self._start_timers()
        self._check_silence()  # Where changes never end, the timer for this is never due.
        return True

    # Timers.

    def _start_timers(self) -> None:
        """Run timers of the present periods."""
        config = self._active
        self._run_timers(
            (1 / config.heartbeat_hz, self._beat),
            (config.input_timeout_s / CHECKS, self._check_silence),
            (SWAP_S, self._check_input),
            (REPORT_S, self._report),
        )

    def _run_timers(self, *wanted: tuple[float, Callable[[], None]]) -> None:
        """Run these timers, of those that run already the same, and no others."""
        before, self._running = self._running, {}
        for each in wanted:
            timer = before.pop(each, None)
            self._running[each] = timer or self.create_timer(*each, clock=STEADY)
        for timer in before.values():
            self.destroy_timer(timer)

    def _beat(self) -> None:
        """Repeat the decisions, if samples still arrive."""
        self._check_silence()
        self._outputs.beat()

    def _check_input(self) -> None:
        """Subscribe to the input; use a chain that was built."""
        if self._samples is None:
            # Subscribers that have heard another detector before first hear false from this one.
            outputs, now_s = self._outputs, time.monotonic()
            self._beat()
            if outputs.slip_subscribers() and outputs.received():
                # The subscribers of other detectors in this process are discovered soon.
                self._listen_s = min(self._listen_s, now_s + SWAP_S)
            if now_s >= self._listen_s:
                self._listen()
        if self._swap():
            self.get_logger().info('the new filters have taken over')

    def _check_silence(self) -> None:
        """Withdraw the decisions if samples have stopped arriving, or this node was held up."""
        timeout_ns = round(1e9 * self._active.input_timeout_s)
        steady_ns = time.monotonic_ns()
        if steady_ns - self._checked_ns > timeout_ns:
            # Earlier samples are too old, and so are some that were sent since then.
            self._heard = False
            away_ns = steady_ns - self._came_ns
            self._waiting_ns = range(self._sent_ns + 1, self._sent_ns + away_ns)
        # The timeout follows the replayed clock while that moves, else the machine's.
        self._replayed = self.get_clock().ros_time_is_active
        now_ns = self.get_clock().now().nanoseconds if self._replayed else steady_ns
        step_ns, self._now_ns, self._checked_ns = now_ns - self._now_ns, now_ns, steady_ns
        if self._heard or step_ns:
            self._moved_ns = steady_ns
        # The clock may be set back.
        self._silent_ns = 0 if self._heard else self._silent_ns + max(step_ns, 0)
        self._heard = False
        if max(self._silent_ns, steady_ns - self._moved_ns) >= LOST_AFTER * timeout_ns:
            if self._outputs.valid:
                self._note('silent', 'no input any more')
            self._outputs.withdraw()

    def _report(self) -> None:
        """Publish the diagnostics."""
        beating = self.get_publishers_info_by_topic(self._heartbeats.topic_name)
        deadlines_s = [each.qos_profile.deadline.nanoseconds * 1e-9 for each in beating]
        self._deadline_s = min(max(deadlines_s, default=0.0), SLOWEST_S)
        for words in (self._senders.complaint(), self._detectors.complaint()):
            if words:
                self.get_logger().error(f'{words}; slip_valid is false')
        self._diagnostics.publish(self._health.summary(), self._frame_id)

    def _on_slip_valid(self, raw: bytes, info: dict[str, int | None]) -> None:
        number = info['publication_sequence_number']
        self._detectors.accepts(number, self._heartbeats.get_publisher_count())
        if self._detectors.several:
            self._outputs.withdraw()

    # The input.

    def _listen(self) -> None:
        """Subscribe to the input; if that fails, try again later.

        A process can use a topic with one type only: if the type was changed, that is until the
        executor has released the previous subscription.
        """
        config = self._active
        self._input = Input(config)
        try:
            self._samples = self.create_subscription(
                self._input.message_class, 'voltages', self._on_voltages, sensor_qos(), raw=True
            )
        except ROS_ERRORS:
            self._note('listen', f'this process has voltages that are no {config.input_type}')

    def _stop_input(self) -> None:
        if self._samples is not None:
            self.destroy_subscription(self._samples)
        self._samples = None

    def _forget_input(self) -> None:
        """Forget names, frame and stamps of earlier samples."""
        config = self._active
        self._stamp_grid = StampGrid(1 / config.sample_rate_hz, config.max_gap_s)
        self._names = config.channel_names or None
        self._frame_id = ''
        self._last_row: Floats | None = None
        self._health.forget(self._stamp_grid)

    def _on_voltages(self, raw: bytes, info: dict[str, int | None]) -> None:
        """Check the samples of a message, run them through the chain, publish what changes."""
        began_ns, timeout_ns = time.monotonic_ns(), 1e9 * self._active.input_timeout_s
        if began_ns - self._checked_ns > timeout_ns:
            self._check_silence()
        source, senders, outputs, chain = self._input, self._senders, self._outputs, self._chain
        publishers = 0 if self._samples is None else self._samples.get_publisher_count()
        if not senders.accepts(info['publication_sequence_number'], publishers):
            self._health.totals['dropped, of several senders'] += 1
            if senders.several:
                self._heard = True
                outputs.withdraw()
            return
        sent_ns = info['source_timestamp'] or 0
        late_ns = began_ns - self._came_ns - (sent_ns - self._sent_ns)
        waited = sent_ns in self._waiting_ns and late_ns > timeout_ns
        if not waited:
            self._came_ns, self._sent_ns = began_ns, sent_ns
        try:
            samples, number = source.read(raw, info, self._replayed)
        except ValueError as error:
            self._note('dropped, no such field', f'{error}: dropped')
            return
        rows, frame_id = samples.volts, samples.frame_id
        if not len(rows):  # An empty batch.
            self._stamp_grid.skip(number)
            return
        if not self._fits(rows, samples.names):
            return
        if not len(samples.stamps_ns):
            # Replayed samples without stamps are taken to have no gaps.
            at_ns = self.get_clock().now().nanoseconds
        else:
            at_ns = int(samples.stamps_ns[-1])
            missing = self._stamp_grid.arrive(at_ns, len(rows), number)
            if missing == DROPPED:
                words = 'the stamp of a message does not fit those before: dropped'
                self._note('dropped, late', words)
                return
            if missing:
                rows = self._mend(rows, missing)
        self._heard = True
        unsettled = chain.unsettled_rows
        listened = outputs.envelope_subscribers() > 0
        result = chain.update(rows, level=listened)
        self._last_row, self._frame_id = rows[-1:], frame_id
        age_s = (self.get_clock().now().nanoseconds - at_ns) * 1e-9
        is_old = waited or 0 < self._active.max_age_s < abs(age_s)
        if is_old or self._stamp_grid.mostly_bad:
            outputs.withdraw()
        elif not self._detectors.several:  # Subscribers could not tell their decisions apart.
            period_ns = self._stamp_grid.period_ns
            for i, flags in enumerate(result.flags):
                stamp_ns = at_ns + round((i + 1 - len(rows)) * period_ns)
                outputs.announce(flags, stamp_ns, frame_id, settled=i >= unsettled)
        if listened:
            outputs.show_envelope(at_ns, result)
        spent_s = (time.monotonic_ns() - began_ns) * 1e-9
        self._health.note(Note(rows, result.valid, at_ns, age_s, spent_s))

    def _fits(self, rows: Floats, names: tuple[str, ...]) -> bool:
        """Return whether a message has the channels of those before; note what is wrong if not."""
        number, channels = rows.shape[1], self._active.channels
        if number != channels:
            allowed = f'{channels}{self._input.advice(number, channels)}'
            words = f'a message has {number} channels, allowed: {allowed}: dropped'
            self._note('dropped, wrong number of channels', words, len(rows))
            return False
        self._names = names if self._names is None else self._names
        if names == self._names or not self._input.has_names:
            return True
        lists = [name_list(each, NAMES) or 'without names' for each in (names, self._names)]
        words = f'the channels of a message are {lists[0]}, allowed: {lists[1]}: dropped'
        self._note('dropped, wrong names', words, len(rows))
        return False

    def _mend(self, rows: Floats, missing: int) -> Floats:
        """Bridge a short gap with the last row, or restart the chain after a long one."""
        if missing > 0 and self._last_row is not None:
            words = f'{missing} samples missing, bridged with the last one'
            self._note('lost and bridged', words, missing)
            return np.concatenate([np.repeat(self._last_row, missing, axis=0), rows])
        self._note('restarts', 'the input had a gap or its clock was set, the chain restarts')
        self._chain.restart()
        self._health.restart()
        return rows

    def _note(self, event: str, words: str, count: int = 1) -> None:
        """Count an event, and log it once a second."""
        totals, now_s = self._health.totals, time.monotonic()
        totals[event] += count
        if now_s - self._logged_s.get(event, -math.inf) >= LOG_S:
            self._logged_s[event] = now_s
            self.get_logger().warning(f'{words} ({totals[event]} so far)')
