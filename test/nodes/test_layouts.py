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

"""The layouts for RViz, PlotJuggler and Foxglove show what the nodes publish."""

import json
import re
import shlex
import subprocess
from xml.etree import ElementTree

import pytest
import yaml
from rclpy.qos import ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.nodes.messages import event_qos
from slip_detector.parameters.detector import DetectorConfig
from support.harness import ROOT

CONFIG = ROOT / 'config'

MARKERS = 'visualization_msgs/msg/MarkerArray'
JOINT_STATE, BOOL = 'sensor_msgs/msg/JointState', 'std_msgs/msg/Bool'
CLASSES = {JOINT_STATE: JointState, BOOL: Bool}

#: What a display of RViz subscribes to.
DISPLAYS = {'rviz_default_plugins/MarkerArray': MARKERS}

#: The topics of each layout, as the nodes publish them (see the tests of the nodes).
OF_CHANNELS = {'/voltages': JOINT_STATE, '/slip_detector/envelope': JOINT_STATE}
DECISIONS = ('/slip', '/slip_valid', '/slip_truth')
GROUPS = tuple(f'/slip/group/{group}' for group in DetectorConfig().groups)
OF_PLOTS = {**OF_CHANNELS, **dict.fromkeys((*DECISIONS, *GROUPS), BOOL)}


def check_field(message_type, field):
    fields = CLASSES[message_type].get_fields_and_field_types()
    assert field in fields, f'{message_type} has no {field}'
    return fields[field]


@pytest.mark.parametrize('layout', ['slip.plotjuggler.xml', 'slip.foxglove.json'])
def test_the_command_of_the_docs_moves_each_topic_of_a_layout_to_a_namespace(layout):
    (command,) = re.findall(r'`(sed .*?)`', (ROOT / 'docs/other_programs.md').read_text())
    *words, _, _, _ = shlex.split(command)
    done = subprocess.run([*words, layout], cwd=CONFIG, capture_output=True, text=True, check=True)
    before, after = (CONFIG / layout).read_text(), done.stdout
    for topic in {*OF_PLOTS, '/slip_view/taxels'}:
        begins = re.compile(rf'(?<=[";]){topic}(?=[."/;])')
        moved = re.compile(rf'(?<=[";])/index{topic}(?=[."/;])')
        assert len(moved.findall(after)) == len(begins.findall(before))
        assert not begins.findall(after)
    assert '"/index/diagnostics"' not in after


# --- RViz ------------------------------------------------------------------------------------


def rviz():
    return yaml.safe_load((CONFIG / 'slip.rviz').read_text())['Visualization Manager']


def test_rviz_subscribes_to_the_markers_as_they_are_published():
    shown = {}
    for display in rviz()['Displays']:
        assert display['Enabled'] is display['Value'] is True
        if 'Topic' in display:
            topic = display['Topic']['Value']
            shown[topic] = DISPLAYS[display['Class']]
            asked = ReliabilityPolicy[display['Topic']['Reliability Policy'].upper()]
            assert asked == event_qos().reliability
            assert display['Topic']['Durability Policy'] == 'Volatile'
    assert shown == {'/slip_view/taxels': MARKERS}


# --- PlotJuggler -----------------------------------------------------------------------------


def plotjuggler():
    return ElementTree.parse(CONFIG / 'slip.plotjuggler.xml').getroot()


def curve_topic(name):
    """Return the topic of a curve, and what of its messages is plotted."""
    joint_state = re.fullmatch(r'(.+)/(\w+)/(position|velocity|effort)', name)
    if joint_state:
        topic, channel, field = joint_state.groups()
        assert channel in DetectorConfig().names
        assert OF_PLOTS[topic] == JOINT_STATE
        return topic, field
    topic, _, field = name.rpartition('/')
    return topic, field


def test_plotjuggler_plots_what_is_published():
    curves = [curve.get('name') for curve in plotjuggler().iter('curve')]
    topics = set()
    for topic, field in map(curve_topic, curves):
        topics.add(topic)
        check_field(OF_PLOTS[topic], field)
    assert topics == OF_PLOTS.keys()
    for topic in OF_CHANNELS:
        plotted = {name for name in curves if name.startswith(f'{topic}/')}
        assert {f'{topic}/{name}/position' for name in DetectorConfig().names} <= plotted


# --- Foxglove --------------------------------------------------------------------------------


def foxglove():
    return json.loads((CONFIG / 'slip.foxglove.json').read_text())


def test_foxglove_plots_what_is_published():
    topics = set()
    for panel in foxglove()['configById'].values():
        for path in panel.get('paths', []):
            assert path['enabled']
            assert path['timestampMethod'] == 'receiveTime'
            if path['value'] == str(DetectorConfig().threshold):
                continue  # a line at this value
            topic, field, index = re.fullmatch(
                r'(/[\w/]+)\.(\w+)(?:\[(\d+)\])?', path['value']
            ).groups()
            topics.add(topic)
            kind = check_field(OF_PLOTS[topic], field)
            assert kind.startswith('sequence') == (index is not None)
            if index is not None:
                assert path['label'] == DetectorConfig().names[int(index)]
            else:
                assert path['label'] == topic.rpartition('/')[2]
    assert topics == OF_PLOTS.keys()
