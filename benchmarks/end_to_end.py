"""The detector node against a bare relay node, for ``slip_benchmark``.

Three processes: the detector as it ships, a relay that runs no chain, and a meter that sends the
samples and receives ``slip`` from both. What is compared, and why so:

- The two nodes take turns within each sample period: sample k goes to the detector when it is due
  and to the relay half a period later, with the same content. Whatever the machine does meanwhile
  hits both, and neither works while the other does.
- The relay publishes a Bool on the very samples on which the detector publishes its changes, not
  on every sample: a Bool for every sample would cost the relay more than the chain costs the
  detector and flatter the ratio. What it is to say travels in ``effort``, of both nodes' messages;
  the detector does not look there. So the relay is the least that a node can do for the same
  input and output, and the detector's heartbeat, ``slip_valid`` and ``slip_onset`` count against
  the detector.
- The detector has all its topics, as it ships, and the default chain, with short windows and a
  threshold at which a tone within the band toggles ``slip`` about fifty times a second. Only one
  channel toggles, and its group with it, while the others of the group stay ON and all other
  channels OFF: so a change of ``slip`` brings one message on ``slip/group/*`` and one on
  ``slip/channel/*``, not twenty.
- The k-th change received belongs to the sample on which the same chain, run offline on the same
  rows, decides. Latency counts from just before that sample is handed to ``publish``, not from
  its nominal stamp: how late the meter wakes up is the same for both and would only bring the
  ratio closer to one.
- Processor time is that of the whole process over the measured span, user and system.
"""

import argparse
import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
from array import array
from pathlib import Path
from types import FrameType
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from slip_detector.nodes.messages import sensor_qos, state_qos, time_message

#: The detector's parameters that are not defaults.
PARAMETERS = {
    'envelope_window_s': 0.008,
    'decision_window_s': 0.008,
    'threshold': 1.0,
}

BASELINE_V = 4.3
TONE_HZ = 12.0
TOGGLING_V = 0.02
#: So much that only the very zero crossings are below the threshold, shorter than the windows.
STAYING_ON_V = 2.0
NOISE_V = 1e-4

#: Before both nodes are heard of, the relay is told to say ON and OFF in turn, so many samples
#: each.
CALL_SAMPLES = 20

#: At rest between calling and the tone, for what is under way to arrive.
REST_S = 0.5

#: Of the tone, not measured: the filters settle and the processes warm up.
WARM_UP_S = 1.0

START_TIMEOUT_S = 60.0
DRAIN_TIMEOUT_S = 5.0
END_TIMEOUT_S = 10.0
SPIN_S = 0.05

NODES = ('detector', 'relay')


class Relay(Node):
    """Subscribes and publishes as the detector does, with nothing in between."""

    def __init__(self) -> None:
        super().__init__('slip_relay')
        self._on = False
        self._slip = self.create_publisher(Bool, 'slip', state_qos())
        self._slip.publish(Bool(data=False))
        self.create_subscription(JointState, 'voltages', self._on_voltages, sensor_qos())

    def _on_voltages(self, message: JointState) -> None:
        on = message.effort[0] > 0.0
        if on != self._on:
            self._on = on
            self._slip.publish(Bool(data=on))


class Meter(Node):
    """Sends the samples and notes what comes back, and when.

    Parameters
    ----------
    namespace
        Of the three nodes; the detector and the relay are each in their own below it.
    rows
        Volts of each sample of the tone.
    states
        What the relay is to say on each.
    names
        Of the channels.
    rate_hz
        Of the samples.
    pids
        Processes of the nodes, whose processor time is read.
    """

    def __init__(
        self,
        namespace: str,
        rows: Any,
        states: Any,
        names: tuple[str, ...],
        rate_hz: float,
        pids: dict[str, int],
    ) -> None:
        super().__init__('slip_meter', namespace=namespace)
        self._messages = [
            (array('d', row), array('d', [float(state)]))
            for row, state in zip(rows.tolist(), states.tolist(), strict=True)
        ]
        self._names = list(names)
        self._rate_hz = rate_hz
        self._pids = pids
        self._stop = threading.Event()
        self.connected = threading.Event()
        self.error: BaseException | None = None
        # By node: when each sample of the tone was sent, what has been received since the rest
        # (time and state of each change), and processor time at both ends of the measured span.
        self.sent_ns: dict[str, list[int]] = {name: [] for name in NODES}
        self.received: dict[str, list[tuple[int, bool]]] = {name: [] for name in NODES}
        self.cpu_s: dict[str, list[float]] = {name: [] for name in NODES}
        self.measured_s: list[float] = []
        self._answered = dict.fromkeys(NODES, False)
        self._resting = False
        self._voltages = [
            self.create_publisher(JointState, f'{name}/voltages', sensor_qos()) for name in NODES
        ]
        # Deeper than the nodes': what counts is when a change arrives, not that this process may
        # have been slow to take it.
        every_state = QoSProfile(
            depth=1000,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        )
        for name in NODES:
            self.create_subscription(Bool, f'{name}/slip', self._noter(name), every_state)
        self.create_subscription(Bool, 'detector/slip_valid', self._on_detector_valid, every_state)
        self.thread = threading.Thread(target=self._play_guarded, daemon=True)
        self.thread.start()

    def destroy_node(self) -> None:
        """Stop sending, then take the node down."""
        self._stop.set()
        self.thread.join()
        super().destroy_node()

    def _noter(self, name: str) -> Any:
        received = self.received[name]
        last = False

        def note(message: Bool) -> None:
            nonlocal last
            now_ns = time.time_ns()
            if message.data == last:  # A heartbeat.
                return
            last = message.data
            if self._resting:
                received.append((now_ns, last))
            else:
                self._answer(name)

        return note

    def _on_detector_valid(self, message: Bool) -> None:
        # At rest ``slip`` stays OFF; but a first sample makes the channels valid.
        if message.data:
            self._answer('detector')

    def _answer(self, name: str) -> None:
        self._answered[name] = True
        if all(self._answered.values()):
            self.connected.set()

    def _play_guarded(self) -> None:
        try:
            self._play()
        except Exception as error:  # Raised where the main thread looks.
            self.error = error

    def _play(self) -> None:
        """Send sample k to the one node at start + k / rate, to the other half a period later."""
        period_s = 1 / self._rate_hz
        start_s, start_ns = time.monotonic(), time.time_ns()
        # A constant input leaves the chain as it was, however much of it is lost.
        rest = array('d', [BASELINE_V] * len(self._names))
        rest_samples = round(REST_S * self._rate_hz)
        warm_up, end = round(WARM_UP_S * self._rate_hz), len(self._messages)
        tone_at: int | None = None
        for k in itertools.count():
            if tone_at is None and self.connected.is_set():
                tone_at = k + rest_samples
            if tone_at is None:
                position, effort = rest, array('d', [float(k // CALL_SAMPLES % 2)])
            elif k < tone_at:
                position, effort = rest, array('d', [0.0])
                self._resting = k >= tone_at - rest_samples // 2
            elif k - tone_at < end:
                position, effort = self._messages[k - tone_at]
            if tone_at is not None and k - tone_at in (warm_up, end):
                for name, pid in self._pids.items():
                    self.cpu_s[name].append(cpu_s(pid))
                self.measured_s.append(time.monotonic())
                if k - tone_at == end:
                    return
            for i, name in enumerate(NODES):
                offset_s = (k + i / len(NODES)) * period_s
                if self._stop.wait(max(0.0, start_s + offset_s - time.monotonic())):
                    return
                header = Header(stamp=time_message(start_ns + round(offset_s * 1e9)))
                message = JointState(
                    header=header, name=self._names, position=position, effort=effort
                )
                sent_ns = time.time_ns()
                self._voltages[i].publish(message)
                if tone_at is not None and k >= tone_at:
                    self.sent_ns[name].append(sent_ns)


def cpu_s(pid: int) -> float:
    """Return the processor time, user and system, that a process has taken so far."""
    # The name in parentheses may hold anything; after it, utime is field 12 and stime field 13.
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def measure(seconds: float) -> dict[str, Any]:
    """Run detector, relay and meter; return the figures of ``end_to_end``.

    Raises
    ------
    RuntimeError
        When a process ends too early or is not heard of in time.
    """
    # The relay, which is this module too, must stay as bare as it claims.
    import numpy as np

    from slip_detector.chain.slip_chain import SlipChain
    from slip_detector.parameters.detector import DetectorConfig

    config = DetectorConfig.from_parameters(PARAMETERS)
    rate_hz = config.sample_rate_hz
    warm_up = round(WARM_UP_S * rate_hz)
    n = warm_up + round(seconds * rate_hz)
    random = np.random.default_rng(0)
    toggling, *staying_on = next(iter(config.groups.values()))
    tone_v = np.zeros(config.channels)
    tone_v[toggling - 1] = TOGGLING_V
    tone_v[np.array(staying_on) - 1] = STAYING_ON_V
    tone = np.sin(2 * np.pi * TONE_HZ / rate_hz * np.arange(n))
    noise_v = NOISE_V * random.standard_normal((n, config.channels))
    rows = BASELINE_V + np.outer(tone, tone_v) + noise_v
    chain = SlipChain(config)
    chain.update(np.full((1, config.channels), BASELINE_V))
    slip = chain.update(rows).slip
    changes = np.flatnonzero(np.diff(slip, prepend=False))

    namespace = f'slip_benchmark_{os.getpid()}'
    words = [word for name in PARAMETERS for word in ('-p', f'{name}:={PARAMETERS[name]}')]
    detector = [sys.executable, '-m', 'slip_detector.nodes.run', 'slip_detector']
    relay = [sys.executable, '-m', 'benchmarks.end_to_end', 'relay']
    processes: dict[str, subprocess.Popen[bytes]] = {}
    meter: Meter | None = None
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        for name, command, more in zip(NODES, (detector, relay), (words, []), strict=True):
            ros = ['--ros-args', '--log-level', 'warn', '-r', f'__ns:=/{namespace}/{name}', *more]
            # Only this process says something on stdout.
            processes[name] = subprocess.Popen([*command, *ros], stdout=subprocess.DEVNULL)
        pids = {name: process.pid for name, process in processes.items()}
        meter = Meter(namespace, rows, slip, config.names, rate_hz, pids)
        executor = SingleThreadedExecutor()
        executor.add_node(meter)
        deadline_s = time.monotonic() + START_TIMEOUT_S
        while not meter.connected.is_set():
            _spin(executor, meter, processes, deadline_s, 'the nodes to be heard of')
        deadline_s = time.monotonic() + REST_S + n / rate_hz + START_TIMEOUT_S
        while meter.thread.is_alive():
            _spin(executor, meter, processes, deadline_s, 'the last sample to be sent')
        drained_s = time.monotonic() + DRAIN_TIMEOUT_S
        while time.monotonic() < drained_s and any(
            len(received) < len(changes) for received in meter.received.values()
        ):
            _spin(executor, meter, processes, deadline_s, 'the last changes')
        return figures(meter, changes, slip[changes], warm_up, rate_hz)
    finally:
        for process in processes.values():
            process.terminate()
        if meter is not None:
            meter.destroy_node()
        for process in processes.values():
            try:
                process.wait(END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        rclpy.try_shutdown()


def _spin(
    executor: SingleThreadedExecutor,
    meter: Meter,
    processes: 'dict[str, subprocess.Popen[bytes]]',
    deadline_s: float,
    what: str,
) -> None:
    """Take what came; raise if a process or the sending has failed or the deadline has passed."""
    for name, process in processes.items():
        if process.poll() is not None:
            raise RuntimeError(f'the {name} ended with the exit code {process.returncode}')
    if meter.error is not None:
        raise RuntimeError(f'sending failed: {meter.error}')
    if time.monotonic() > deadline_s:
        raise RuntimeError(f'waited in vain for {what}')
    executor.spin_once(timeout_sec=SPIN_S)


def match(
    stamps_ns: list[int], states: list[bool], received: list[tuple[int, bool]]
) -> list[int | None]:
    """Find the receipt of each change.

    Parameters
    ----------
    stamps_ns : list of int
        When the sample of each change was sent, in order.
    states : list of bool
        What each change is to.
    received
        Time of receipt in nanoseconds and state, in order, each differing from the one before.

    Returns
    -------
    list of int or None
        Latency of each change in nanoseconds; None where it was lost.
    """
    # As long as nothing is lost, the k-th received is the k-th change, however late. After a
    # loss a receipt belongs to the change before the next of its kind.
    lost_some = len(received) < len(stamps_ns)
    latencies_ns: list[int | None] = []
    next_one = 0
    for k, (stamp_ns, state) in enumerate(zip(stamps_ns, states, strict=True)):
        j = next_one
        while j < len(received) and (received[j][0] < stamp_ns or received[j][1] != state):
            j += 1
        last = not lost_some or k + 2 >= len(stamps_ns)
        if j < len(received) and (last or received[j][0] < stamps_ns[k + 2]):
            latencies_ns.append(received[j][0] - stamp_ns)
            next_one = j + 1
        else:
            latencies_ns.append(None)
    return latencies_ns


def figures(
    meter: Meter, changes: Any, states: Any, warm_up: int, rate_hz: float
) -> dict[str, Any]:
    """Compute latencies and processor times from what the meter noted."""
    import numpy as np

    counted = changes >= warm_up
    result: dict[str, Any] = {
        'rate_hz': rate_hz,
        'samples': len(meter.sent_ns['detector']) - warm_up,
        'changes': int(counted.sum()),
    }
    span_s = meter.measured_s[1] - meter.measured_s[0]
    for name in NODES:
        sent_ns = np.array(meter.sent_ns[name])[changes].tolist()
        matched = match(sent_ns, states.tolist(), meter.received[name])
        of_interest = [ns for ns, count in zip(matched, counted, strict=True) if count]
        latencies_ms = [ns * 1e-6 for ns in of_interest if ns is not None]
        if not latencies_ms:
            raise RuntimeError(f'no change of slip arrived from the {name}')
        used_s = meter.cpu_s[name][1] - meter.cpu_s[name][0]
        result[name] = {
            'median_ms': float(np.median(latencies_ms)),
            'p99_ms': float(np.percentile(latencies_ms, 99)),
            'cpu_percent': 100 * used_s / span_s,
            'lost': len(of_interest) - len(latencies_ms),
        }
    mine, theirs = result['detector'], result['relay']
    result['latency_ratio'] = mine['median_ms'] / theirs['median_ms']
    result['cpu_ratio'] = mine['cpu_percent'] / theirs['cpu_percent']
    return result


def relay() -> None:
    """Spin the relay until a signal comes."""
    rclpy.init()
    node = Relay()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _terminated(number: int, frame: FrameType | None) -> None:
    """Turn the signal into an exception, so that the processes are ended."""
    sys.exit(128 + number)


def main() -> int:
    """Run as a process: the relay, or the meter with all that it needs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('role', choices=('relay', 'measure'))
    parser.add_argument('--seconds', type=float, default=20.0, help='measured time')
    words, _ = parser.parse_known_args()
    if words.role == 'relay':
        relay()
        return 0
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _terminated)
    try:
        print(json.dumps(measure(words.seconds)))
    except (RuntimeError, ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
