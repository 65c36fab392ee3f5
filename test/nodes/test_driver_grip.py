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

"""The driver's grip on an object, commanded from outside."""

from sensor_msgs.msg import JointState

from slip_detector.nodes.messages import stamp_ns, state_qos
from support.harness import patient_qos

#: Slow samples: that of one block are a good part of a second.
RATE_HZ = 50.0

#: A gripper that follows at once, and an object that falls out of a weak grip.
SCENE = f"""
sample_rate_hz: {RATE_HZ}
steps:
  - {{duration_s: 0.2, force_n: 3.0}}
  - {{duration_s: 0.4, carried: 1.0}}
  - {{duration_s: 60.0}}
motion: {{ringing_hz: 500.0, ringing_damping: 1.0}}
friction: {{stribeck_velocity_m_s: 0.1}}
object: {{mass_kg: 0.2, length_m: 0.05, rest_patches: 200}}
"""


def test_a_driver_waits_for_the_first_command_and_the_next_is_felt_in_the_next_samples(
    bench, tmp_path
):
    voltages = bench.listen(JointState, 'voltages', patient_qos())
    position = bench.listen(JointState, 'platform_position', patient_qos())
    command = bench.node.create_publisher(JointState, 'grip_force', state_qos())
    path, clock = tmp_path / 'scene.yaml', bench.node.get_clock()
    path.write_text(SCENE)
    parameters = {'source': 'scene', 'scene': path, 'wait_for_grip': 'true'}
    process = bench.start('slip_driver', parameters={**parameters, 'wait_for_subscribers': 1})

    def said(words):
        bench.wait_for(lambda: words in process.log(), f'the log to say {words}')

    def hold(*efforts):
        at_ns = clock.now().nanoseconds
        command.publish(JointState(name=['grip'], effort=efforts))
        return at_ns

    def play(seconds):
        """Wait until so much more of the scene was heard, from now on: samples may come late."""
        end_ns = clock.now().nanoseconds + round(seconds * 1e9)
        bench.wait_for(
            lambda: voltages and stamp_ns(voltages[-1].header.stamp) >= end_ns,
            f'{seconds} s of samples',
        )

    # Until the first command comes, the scene itself would grip with 3 N.
    said('waiting for a grip force')
    bench.wait_for(command.get_subscription_count, 'the driver to listen')
    hold(float('nan'))
    said('force_n is nan N, allowed: 0 to 1000 N; ignored')
    for _ in range(20):
        bench.executor.spin_once(timeout_sec=0.02)
    assert not voltages
    hold(2.0)
    play(1.0)
    # A command that makes no sense does not let the object fall.
    hold(1.0, 2.0)
    said('grip_force has 2 efforts, allowed: 1; ignored')
    play(0.5)
    assert position[-1].position[0] < 1e-4
    at_ns = hold(6.0)
    play(2.0)
    # Volts sink as the load grows: a step of newtons stands out from the noise by far.
    rows = [(stamp_ns(each.header.stamp), each.position[0]) for each in voltages]
    *_, firm_v = (volts for stamp, volts in rows if stamp <= at_ns)
    felt_ns = min(stamp for stamp, volts in rows if volts < firm_v - 0.05)
    # A block of samples read ahead would be later than this.
    assert 0 < felt_ns - at_ns < 0.5 * 32 / RATE_HZ * 1e9
