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

"""Real nodes in real processes, and a node of the test's own that talks to them."""

import fcntl
import functools
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from support.domains import own_domain

rclpy = pytest.importorskip('rclpy', reason='needs rclpy')

from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float32MultiArray, Header, MultiArrayDimension

from slip_detector.chain.slip_chain import compile_chain
from slip_detector.nodes.messages import event_qos, sensor_qos, stamp_ns, state_qos, time_message
from slip_detector.parameters.driver import DriverConfig
from slip_detector.sources import open_source

#: Discovery takes seconds now and then; nothing here is about speed.
DEADLINE_S = 90.0

#: Seconds after which a service that has not answered is asked again.
ASK_AGAIN_S = 1.0

ROOT = Path(__file__).resolve().parents[2]

RELIABLE_SAMPLES = ROOT / 'test' / 'support' / 'reliable_samples.py'

#: Stamp of a first sample, and the time from sample to sample at the rate of the paper.
START_NS, PERIOD_NS = 1_700_000_000 * 10**9, round(1e9 / 380)


class Process:
    """A command as a process; its output is kept, and shown if the test fails, or is a file."""

    def __init__(self, *command, domain, output=None, environment=None):
        command = list(map(str, command))
        self._command = ' '.join(command)
        self.killed = False
        self._log = tempfile.TemporaryFile('w+')  # noqa: SIM115, closed in end()
        environment = {**os.environ, 'ROS_DOMAIN_ID': str(domain), **(environment or {})}
        self._process = subprocess.Popen(
            command, stdout=output or self._log, stderr=subprocess.STDOUT, env=environment
        )
        self.pid = self._process.pid

    def log(self):
        """Return what the process has printed so far."""
        # The process writes where the file stands; to seek would have it write over the beginning.
        file = self._log.fileno()
        return os.pread(file, os.fstat(file).st_size, 0).decode(errors='replace')

    def lines(self):
        """Return the lines that the process has printed so far, without those of Fast DDS.

        Some of its ports in shared memory are shared by all domains; where two processes open one
        at the same time it prints an error, and takes another port.
        """
        # Its name may stand between codes of colours.
        return [line for line in self.log().strip().splitlines() if 'RTPS_' not in line]

    def ended(self):
        return self._process.poll() is not None

    def signal(self, number):
        """Send a signal; return after SIGSTOP when all threads stand still."""
        self._process.send_signal(number)
        self.killed |= number == signal.SIGKILL
        if number == signal.SIGSTOP:  # On a busy machine some threads go on for milliseconds.
            os.waitid(os.P_PID, self.pid, os.WSTOPPED)

    def wait(self):
        """Wait for the end and return the exit code."""
        return self._process.wait(timeout=DEADLINE_S)

    def refusal(self, code=1):
        """Wait for the end with an exit code; return the one line that the process has printed."""
        assert self.wait() == code, self.log()
        assert len(self.lines()) == 1, self.log()
        return self.lines()[0]

    def end_quietly(self, *numbers):
        """End it by signals that come at once, else by SIGINT; check that it takes them well."""
        for number in numbers or (signal.SIGINT,):
            self.signal(number)
        assert self.wait() == 0, self.log()
        assert 'Traceback' not in self.log()

    def end(self):
        """End it as a user would; kill it when that fails."""
        self._process.terminate()
        self._process.send_signal(signal.SIGCONT)  # A stopped process handles no SIGTERM.
        try:
            self.wait()
        except subprocess.TimeoutExpired:
            self._process.kill()
            raise
        finally:
            if not self._log.closed:  # It has ended before.
                print(f'{self._command}:\n{self.log()}')  # pytest shows this if the test fails.
                self._log.close()


def patient_qos():
    """Return the profile of samples for a test, which may be held up for longer than a node."""
    return QoSProfile(depth=20_000, reliability=ReliabilityPolicy.BEST_EFFORT)


def reliable_qos():
    """Return the profile of samples for a test that needs each of them.

    The other side offers it, or asks for it, if it was started with ``reliable_samples``.
    """
    return event_qos(20_000)


def patient_state_qos():
    """Return the profile of states for a test that must see each change, however late it looks."""
    return state_qos(depth=1000)


@functools.cache
def compile_nodes():
    """Compile what the nodes run, once for all processes: it may take longer than a test waits."""
    path = Path(tempfile.gettempdir()) / f'slip_detector_test_compiling_{os.getuid()}'
    with path.open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        compile_chain()
        for scene in ('plate_400um', 'grasp'):
            open_source(DriverConfig(source='scene', scene=scene)).read(1)


class Bench:
    """A domain with a node of the test's own and any number of processes."""

    def __init__(self):
        compile_nodes()
        self.domain, self._lock = own_domain()
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.node = Node('bench', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.processes = []
        self._subscriptions = {}
        self._clients = {}

    def start(self, name, *words, parameters=None, reliable_samples=False, **options):
        """Start an executable of the package, with options of :class:`Process`."""
        run = ['-m', 'slip_detector.nodes.run']
        if reliable_samples:
            run = ['-P', RELIABLE_SAMPLES]  # -P: nothing is imported from the file's own folder.
        command = [*run, name, '--ros-args']
        for key, value in (parameters or {}).items():
            command += ['-p', f'{key}:={value}']
        return self.start_python(*command, *words, **options)

    def start_python(self, *words, **options):
        """Start Python with these words, and options of :class:`Process`."""
        process = Process(sys.executable, *words, domain=self.domain, **options)
        self.processes.append(process)
        return process

    def start_executable(self, name, *words):
        """Start an executable of the package that is no node, such as ``slip_demo``."""
        return self.start_python('-m', 'slip_detector.nodes.run', name, *words)

    def start_view(self, *words):
        """Start slip_view on a free port; return the process and the address of its page."""
        view = self.start_executable('slip_view', '--port', '0', *words)
        self.wait_for(lambda: 'http://' in view.log(), 'the address', view)
        return view, re.search(r'^slip_view: (http://\S+)$', view.log(), re.M)[1]

    def check_refused(self, name, parameters, words):
        """Check that a node ends at its start with one line, which has all the words in it."""
        line = self.start(name, parameters=parameters).refusal()
        assert line.startswith(f'{name}: ')
        assert [word for word in words if word not in line] == [], line

    def start_driver(self, parameters):
        """Start a driver that plays when all subscriptions of the test know it.

        A publisher that has found a subscription may send before the subscription has found the
        publisher; such samples are lost. So the driver waits for one subscriber more than there
        are, and the last one subscribes when those of the test know the driver. The driver's
        samples are reliable.
        """
        subscriptions = self._subscriptions['voltages']
        wanted = {'wait_for_subscribers': len(subscriptions) + 1}
        given = {'source': 'scene', **parameters, **wanted}
        process = self.start('slip_driver', parameters=given, reliable_samples=True)

        def known():
            return all(subscription.get_publisher_count() for subscription in subscriptions)

        self.wait_for(known, 'the driver to be known', process)
        self.node.create_subscription(
            subscriptions[0].msg_type, 'voltages', lambda message: None, sensor_qos()
        )
        return process

    def ask(self, service_type, service, request):
        """Call a service and return its response."""
        future = self.client(service_type, service).call_async(request)
        self.wait_for(future.done, service)
        return future.result()

    def values_of(self, node, *names):
        """Return the values of parameters of a node."""
        request = GetParameters.Request(names=names)
        values = self.ask(GetParameters, f'{node}/get_parameters', request).values
        return [*map(parameter_value_to_python, values)]

    def set_each(self, node, values):
        """Set parameters with the ordinary service; return the result of each."""
        request = SetParameters.Request(parameters=parameter_messages(values))
        return self.ask(SetParameters, f'{node}/set_parameters', request).results

    def set_whole(self, node, values):
        """Set parameters as a set; return the result."""
        request = SetParametersAtomically.Request(parameters=parameter_messages(values))
        service = f'{node}/set_parameters_atomically'
        return self.ask(SetParametersAtomically, service, request).result

    def client(self, service_type, service):
        """Return a client that the service knows: its responses arrive.

        A service may answer before it knows the client; that response is lost. A request of
        default values, which changes nothing, is sent again and again until it is answered.
        """
        client = self._clients.get(service)
        if client is not None:
            return client
        client = self._clients[service] = self.node.create_client(service_type, service)
        self.wait_for(client.service_is_ready, service)
        asked = []

        def answered():
            asked.append(client.call_async(service_type.Request()))
            self.executor.spin_until_future_complete(asked[-1], ASK_AGAIN_S)
            return any(future.done() for future in asked)

        self.wait_for(answered, f'an answer of {service}')
        return client

    def wait_for(self, condition, what, process=None):
        """Spin until the condition holds; fail with what all processes said, or if one ends."""
        deadline = time.monotonic() + DEADLINE_S
        while not condition():
            if time.monotonic() > deadline or (process and process.ended()):
                logs = '\n'.join(process.log() for process in self.processes)
                pytest.fail(f'waited in vain for {what}; the processes said:\n{logs}')
            self.executor.spin_once(timeout_sec=0.05)

    def wait_until_forgotten(self, name):
        """Wait until the middleware has forgotten the node of a killed process.

        Fast DDS deletes the shared memory of a killed process when it is found dead. Where that
        meets the start of its successor, the successor's is deleted: it hears nothing, and nobody
        sees it (see docs/faults.md).
        """
        self.wait_for(lambda: name not in self.node.get_node_names(), f'{name} to be forgotten')

    def subscribed(self, name):
        """Return the topics that a node subscribes to; its services may be known before it is."""
        self.wait_for(lambda: name in self.node.get_node_names(), f'{name} to be known')
        found = self.node.get_subscriber_names_and_types_by_node(name, '/')
        return {topic for topic, _ in found}

    def listen(self, message_type, topic, qos):
        """Return the list that messages of a topic are put on."""
        heard = []
        subscription = self.node.create_subscription(message_type, topic, heard.append, qos)
        self._subscriptions.setdefault(topic, []).append(subscription)
        return heard

    def close(self):
        """End the processes and the node.

        For some time after a process was killed Fast DDS replaces shared memory, also in the other
        processes. Where that meets the end of a node, Fast DDS unmaps what the end waits for, and
        the process dies of it: so the node ends when the dead one is forgotten.
        """
        for process in self.processes:
            process.end()
        try:
            if any(process.killed for process in self.processes):
                alone = [self.node.get_name()]
                self.wait_for(
                    lambda: self.node.get_node_names() == alone,
                    'the killed process to be forgotten',
                )
        finally:
            self.executor.shutdown()
            self.node.destroy_node()
            rclpy.try_shutdown(context=self.context)
            os.close(self._lock)


def parameter_messages(values):
    return [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]


def sample(position, at_ns, frame_id='', **fields):
    """Return a sample as a message."""
    header = Header(stamp=time_message(at_ns), frame_id=frame_id)
    return JointState(header=header, position=position, **fields)


def batch_of(rows):
    """Return rows as one message; they are an array of the shape (samples, channels)."""
    samples, channels = rows.shape
    message = Float32MultiArray(data=rows.ravel().tolist())
    message.layout.dim = [
        MultiArrayDimension(label='sample', size=samples, stride=rows.size),
        MultiArrayDimension(label='channel', size=channels, stride=channels),
    ]
    return message


class Beating:
    """The test in place of a detector: it says what slip is, again and again while it waits."""

    def __init__(self, bench):
        self.bench, self.state = bench, {'slip': False, 'slip_valid': True}
        self.says = {
            topic: bench.node.create_publisher(Bool, topic, state_qos(deadline_s=0.2))
            for topic in self.state
        }

    def say(self, **state):
        """Say what slip is from now on, and say it once."""
        self.state.update(state)
        for topic, says in self.says.items():
            says.publish(Bool(data=self.state[topic]))

    def wait_for(self, condition, what, beating=True):
        """Wait until the condition holds, the heart of the detector beating meanwhile."""

        def beaten():
            if beating:
                self.say()
            return condition()

        self.bench.wait_for(beaten, what)


class Detected:
    """A detector process fed by the test, sample by sample, and what it publishes.

    Samples and decisions are reliable here, as each is compared (see ``reliable_samples``).
    """

    def __init__(self, bench, parameters=None, message_type=JointState):
        self.bench = bench
        self.envelope = bench.listen(JointState, 'slip_detector/envelope', reliable_qos())
        self.slip = bench.listen(Bool, 'slip', patient_state_qos())
        self.valid = bench.listen(Bool, 'slip_valid', patient_state_qos())
        self.voltages = bench.node.create_publisher(message_type, 'voltages', reliable_qos())
        self.process = bench.start('slip_detector', parameters=parameters, reliable_samples=True)
        bench.wait_for(
            lambda: self.voltages.get_subscription_count() and self.slip and self.valid,
            'the detector to connect',
            self.process,
        )

    def send(self, volts, at_ns, names=()):
        """Publish a sample."""
        self.voltages.publish(sample(volts, at_ns, name=names))

    def answered(self, at_ns):
        """Return whether the decision on the sample of this stamp has come."""
        return any(stamp_ns(heard.header.stamp) == at_ns for heard in self.envelope[-3:])

    def settle(self, row, at_ns, period_ns):
        """Send one row over and over until decisions come; returns the next stamp.

        Until the envelope's subscription has reached the detector there are none; then all
        subscriptions made before it have reached the detector too. A constant input leaves the
        chain at rest, so it does not matter how many of them it took.
        """

        def answered():
            nonlocal at_ns
            self.send(row, at_ns)
            at_ns += period_ns
            return self.envelope

        self.bench.wait_for(answered, 'a decision')
        return self.send_all([row], at_ns, period_ns)

    def send_all(self, rows, at_ns, period_ns):
        """Send rows, each when the one before was answered; returns the next stamp."""
        for row in rows:
            self.send(row, at_ns)
            self.bench.wait_for(lambda at_ns=at_ns: self.answered(at_ns), f'the decision {at_ns}')
            at_ns += period_ns
        return at_ns
