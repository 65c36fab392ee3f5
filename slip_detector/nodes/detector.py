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

import functools
import threading
import time

import numpy as np
from numpy.typing import NDArray
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from std_msgs.msg import Bool

from slip_detector.chain.live_chain import HISTORY_S, INPUT_PARAMETERS, LiveChain
from slip_detector.chain.slip_chain import SlipResult, check_memory
from slip_detector.chain.stamps import Arrival, StampGrid
from slip_detector.nodes.channel_names import ChannelNames
from slip_detector.nodes.decorators import exclusive, explained
from slip_detector.nodes.diagnostics import Diagnostics
from slip_detector.nodes.event_log import EventLog
from slip_detector.nodes.executor import put_off
from slip_detector.nodes.health import Health
from slip_detector.nodes.inputs import Input
from slip_detector.nodes.outputs import TOPIC_PARAMETERS, Outputs, check_topics
from slip_detector.nodes.parameters import declare, follow_changes
from slip_detector.nodes.rclpy_internals import (
    ROS_ERROR,
    answer_impossible_transitions,
    destroy_state_machine,
)
from slip_detector.nodes.senders import SenderWatch
from slip_detector.nodes.silence import LOOKS, SilenceWatch
from slip_detector.nodes.timers import Timers
from slip_detector.parameters.detector import DetectorConfig

#: Period, in seconds, at which a failed subscription to the input is tried again.
LISTEN_S = 0.02

#: Shortest time, in seconds, for which several publishers of a topic count as sending after they
#: were heard in turns.
SEVERAL_S = 1.0

#: Parameters that have an effect only while the node starts.
FIXED = ('autostart',)


class Detector(LifecycleNode):
    """Runs the chain on each sample and publishes decisions that change.

    It is a managed node: *configure* builds the chain and the topics, *activate* subscribes to the
    input. While inactive, it publishes nothing and has no subscription and no timer.

    One thread handles samples and timers, another one services, and a third one builds chains. A
    lock protects the state that they share; it is not held while a chain is built.

    Parameters
    ----------
    cli_args
        ROS arguments for this node, which override those of the process.
    """

    def __init__(self, cli_args: list[str] | None = None) -> None:
        super().__init__('slip_detector', allow_undeclared_parameters=True, cli_args=cli_args)
        # The configuration that was set last; the chain has it once its filters are built.
        self.config = declare(self, DetectorConfig, FIXED, cli_args)
        self._check(self.config)
        follow_changes(self, lambda: self.config, self._check, self._take)
        self._lock = threading.RLock()
        self._outputs: Outputs | None = None
        self._input: Input | None = None
        self._senders: SenderWatch | None = None
        self._running_timers = Timers(self)
        answer_impossible_transitions(self)
        self._failed = ''
        if self.config.autostart:
            for trigger in (self.trigger_configure, self.trigger_activate):
                if trigger() is not TransitionCallbackReturn.SUCCESS:
                    raise ValueError(self._failed or 'the node cannot be started')

    # The life of the node.

    @explained
    @exclusive
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Build the chain and the topics."""
        config = self.config
        self._chain = LiveChain(config, self._on_built)
        self._health = Health(config)
        self._events = EventLog(self._health.totals, self.get_logger().warning)
        self._outputs = Outputs(self, config)
        disabled = len(config.disabled_channels)
        self.get_logger().info(
            f'{config.channels - disabled} channels at {config.sample_rate_hz:g} Hz, '
            f'groups {", ".join(config.groups)}'
        )
        return TransitionCallbackReturn.SUCCESS

    @explained
    @exclusive
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Subscribe to the input."""
        self._chain.reset()
        self._forget_input()
        self._diagnostics = Diagnostics(self)
        self._choose_clock()
        self._reported_s = time.monotonic()
        for name in ('beat', 'look', 'report'):
            self._start_timer(name)
        self._listen()
        self._listen_to_others()
        return TransitionCallbackReturn.SUCCESS

    def destroy_node(self) -> None:
        """Destroy the node and what its life cycle is kept in."""
        super().destroy_node()
        destroy_state_machine(self)

    @exclusive
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish that slip is not valid, then stop publishing."""
        self._running_timers.stop_all()
        self._stop_input()
        self._detectors.destroy()
        self._diagnostics.destroy()
        self._topics.withdraw()
        return TransitionCallbackReturn.SUCCESS

    @exclusive
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy the topics."""
        self._topics.destroy()
        self._outputs = None
        return TransitionCallbackReturn.SUCCESS

    @exclusive
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy everything, from any state."""
        if self._running_timers:
            self.on_deactivate(state)
        if self._outputs is not None:
            self.on_cleanup(state)
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Return to the unconfigured state after a failed transition."""
        return self.on_shutdown(state)

    @property
    def _topics(self) -> Outputs:
        assert self._outputs is not None, 'not configured'
        return self._outputs

    @exclusive
    def _listen(self) -> None:
        """Subscribe to the input; if that fails, try again later.

        A process can use a topic with one type only: if the type was changed, that is until the
        thread that waits for samples has released the previous subscription.
        """
        if self._senders is not None or not self._running_timers:
            return
        source = Input(self._running)
        source.replayed = self._replayed
        window_s = max(SEVERAL_S, self._running.input_timeout_s)
        call = functools.partial(self._on_voltages, source)
        try:
            self._senders = SenderWatch(self, source.message_class, 'voltages', call, window_s)
        except ROS_ERROR:
            kind = self._running.input_type
            self._events.note('listen', f'this process has voltages with a type other than {kind}')
            self._start_timer('listen')
            return
        self._input = source
        self._running_timers.stop('listen')

    def _listen_to_others(self) -> None:
        """Watch for the heartbeat of another detector that publishes on the same topics."""
        window_s = max(SEVERAL_S, 3 / self._running.heartbeat_hz)
        self._detectors = SenderWatch(
            self, Bool, 'slip_valid', lambda raw, info: self._on_slip_valid(info), window_s
        )

    def _stop_input(self) -> None:
        """Ignore further samples, even those that the other thread has already received."""
        if self._senders is not None:
            self._senders.destroy()
        self._senders = self._input = None

    def _forget_input(self) -> None:
        """Forget names, frame and stamps of earlier samples."""
        config = self.config
        self._stamp_grid = StampGrid(1 / config.sample_rate_hz, config.max_gap_s)
        self._names = ChannelNames(config.channels, config.channel_names)
        self._frame_id = ''
        self._last_row: NDArray[np.float64] | None = None
        self._heard_s = float('-inf')

    def _time_is_replayed(self) -> bool:
        return bool(self.get_parameter('use_sim_time').value)

    def _now_ns(self) -> int:
        """Return the time of the node's clock; if it is the machine's, in a tenth of the time."""
        return self.get_clock().now().nanoseconds if self._replayed else time.time_ns()

    # Timers. A clock that is set back or not published must not stop the heartbeat, so only the
    # timeout follows a replayed clock. A timer may still be called just after another thread has
    # stopped it: each callback checks whether the node is active.

    @exclusive
    def _beat(self) -> None:
        if self._running_timers:
            self._topics.beat()

    def _choose_clock(self) -> None:
        """Let the timeout follow the replayed clock, or the machine's if there is none."""
        self._replayed = self._time_is_replayed()
        if self._input is not None:
            self._input.replayed = self._replayed
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timeout_clock = self.get_clock() if self._replayed else self._steady
        self._silence = SilenceWatch(self._timeout_clock.now().nanoseconds)

    def _start_timer(self, name: str) -> None:
        config = self._running
        timers = {
            'beat': (1 / config.heartbeat_hz, self._beat, self._steady),
            'look': (config.input_timeout_s / LOOKS, self._look_for_input, self._timeout_clock),
            'report': (1.0, self._report, self._steady),
            'listen': (LISTEN_S, self._listen, self._steady),
        }
        self._running_timers.start(name, *timers[name])

    @exclusive
    def _look_for_input(self) -> None:
        """Withdraw the decisions if samples have stopped arriving."""
        if not self._running_timers:
            return
        now_ns = self._timeout_clock.now().nanoseconds
        lost = self._silence.is_lost(now_ns, self._running.input_timeout_s)
        # `_last_row` is None, too, if the input was changed and has been silent since.
        if lost and (self._last_row is not None or self._topics.valid):
            self._events.note('silent', 'no input any more')
            self._topics.withdraw()

    @exclusive
    def _report(self) -> None:
        """Publish the diagnostics."""
        if not self._running_timers:
            return
        now_s = time.monotonic()
        health, topics = self._health, self._topics
        health.totals['onsets'] = topics.onsets
        health.senders = [] if self._senders is None else self._senders.names()
        health.detectors = self._detectors.names()
        for topic, names in (('voltages', health.senders), ('slip', health.detectors)):
            if names:
                self.get_logger().error(
                    f'{topic} is published by {" and ".join(names)}, allowed: one of them; '
                    'slip_valid is false'
                )
        statuses = health.summary(
            now_s - self._reported_s,
            silent_s=now_s - self._heard_s,
            slip=topics.slip,
            valid=topics.valid,
        )
        self._reported_s = now_s
        self._diagnostics.publish(statuses, self._frame_id)

    # Parameters.

    @property
    def _running(self) -> DetectorConfig:
        config = self._chain.config
        assert isinstance(config, DetectorConfig)
        return config

    def _check(self, config: DetectorConfig) -> None:
        """Raise a ValueError if a configuration cannot be run."""
        check_memory(config, HISTORY_S)
        check_topics(self, config)
        Input(config)

    def _take(self, config: DetectorConfig) -> None:
        """Use a new configuration, at once or when its chain is built."""
        self.config = config
        if self._outputs is not None and self._chain.change(config):
            self._swap()

    def _on_built(self) -> None:
        if self._swap():
            self.get_logger().info('the new filters have taken over')

    @exclusive
    def _swap(self) -> bool:
        """Use the new chain from the next row on, if it is ready; return whether it was."""
        if self._outputs is None:
            return False
        before = self._running
        if not self._chain.swap():
            return False
        self._rearrange(before)
        return True

    def _rearrange(self, before: DetectorConfig) -> None:
        """Adapt topics, timers and input to the configuration that the chain now has."""
        config = self._running
        differ = {name for name in vars(config) if getattr(config, name) != getattr(before, name)}
        self._health.configure(config)
        if differ & TOPIC_PARAMETERS:
            self._outputs = Outputs(self, config, self._outputs)
        if not self._running_timers:
            return
        if differ & {'input_type', 'input_field'}:
            self._stop_input()
            self._start_timer('listen')
        if differ & {*INPUT_PARAMETERS, 'channel_names'}:
            self._forget_input()
        self._stamp_grid.max_gap_s = config.max_gap_s
        if 'heartbeat_hz' in differ:
            self._start_timer('beat')
        if self._replayed != self._time_is_replayed():
            self._choose_clock()
            # A step between two clocks is no gap in the input.
            self._stamp_grid = StampGrid(1 / config.sample_rate_hz, config.max_gap_s)
            self._start_timer('look')
        elif 'input_timeout_s' in differ:
            self._start_timer('look')

    @exclusive
    def _on_slip_valid(self, info: dict[str, int | None]) -> None:
        if self._running_timers:
            self._detectors.accepts_message(info)
            if self._detectors.several:
                self._topics.withdraw()

    # The input.

    def _on_voltages(self, source: Input, raw: bytes, info: dict[str, int | None]) -> None:
        with self._lock:
            if source is self._input and self._senders is not None:
                self._decide_on(source, self._senders, raw, info)

    def _decide_on(
        self, source: Input, senders: SenderWatch, raw: bytes, info: dict[str, int | None]
    ) -> None:
        """Check the samples of a message, run them through the chain, publish what changes."""
        began_s = time.perf_counter()
        config = self._chain.config
        if not senders.accepts_message(info):
            self._health.totals['senders'] += 1
            if senders.several:
                self._silence.heard = True
                self._topics.withdraw()
            return
        try:
            rows, at_ns, names, frame_id, number = source.read(raw, info)
        except ValueError as error:
            self._drop('field', str(error))
            return
        n, channels = rows.shape
        if not n:  # an empty batch
            self._stamp_grid.skip(number)
            return
        if channels != config.channels:
            self._drop(
                'channels', f'a message has {channels} channels, allowed: {config.channels}'
            )
            return
        if source.has_names and (refusal := self._names.refusal(names)):
            self._drop('names', refusal)
            return
        if at_ns is None:
            # Replayed samples without stamps are taken to have no gaps.
            at_ns = self._now_ns()
        else:
            arrival = self._stamp_grid.arrive(at_ns, n, number)
            if not arrival.accepted:
                self._drop('backwards', 'the stamp of a message is not after the one before')
                return
            if arrival.missing or arrival.reset:
                rows = self._mend(rows, arrival)
        self._silence.heard = True
        topics = self._topics
        unsettled = self._chain.unsettled_rows
        listened = topics.envelope_subscribers() > 0
        result = self._chain.update(rows, level=listened)
        self._last_row = rows[-1:]
        self._frame_id = frame_id
        if self._detectors.several:
            pass  # Subscribers could not tell these decisions from the other detector's.
        elif len(rows) == 1:
            topics.announce(result.flags[0], at_ns, self._frame_id, settled=not unsettled)
        else:
            period_ns = self._stamp_grid.period_ns
            for i, flags in enumerate(result.flags):
                stamp_ns = at_ns + round((i + 1 - len(rows)) * period_ns)
                topics.announce(flags, stamp_ns, self._frame_id, settled=i >= unsettled)
        age_s = (self._now_ns() - at_ns) * 1e-9
        if listened:
            # Decisions of other fingers in this process must not wait for the envelope.
            put_off(self, functools.partial(self._show_envelope, at_ns, frame_id, result))
        self._heard_s = time.monotonic()
        spent_s = time.perf_counter() - began_s
        self._health.note_rows(rows, result.valid, at_ns, age_s, spent_s)

    @exclusive
    def _show_envelope(self, at_ns: int, frame_id: str, result: SlipResult) -> None:
        """Publish the levels of a sample, unless the number of channels has changed since."""
        if self._running_timers and result.channels.shape[1] == self._running.channels:
            self._topics.show_envelope(at_ns, frame_id, result)

    def _mend(self, rows: NDArray[np.float64], arrival: Arrival) -> NDArray[np.float64]:
        """Bridge a short gap with the last row, or restart the chain after a long one."""
        if arrival.missing and self._last_row is not None:
            missing = arrival.missing
            self._events.note(
                'bridged', f'{missing} samples missing, bridged with the last one', missing
            )
            return arrival.bridge(self._last_row, rows)
        self._events.note('reset', 'the input had a gap or its clock was set, the chain restarts')
        self._chain.restart()
        self._health.restart()
        return rows

    def _drop(self, kind: str, what: str) -> None:
        self._events.note(kind, f'{what}: dropped')
