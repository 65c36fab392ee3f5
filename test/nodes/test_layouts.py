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

NAMES = DetectorConfig().names

#: The topics of each layout of curves, as the nodes publish them (see the tests of the nodes).
OF_CHANNELS = ('/voltages', '/slip_detector/envelope')
DECISIONS = ('/slip', '/slip_valid', '/slip_truth')
GROUPS = tuple(f'/slip/group/{group}' for group in DetectorConfig().groups)
OF_PLOTS = {**dict.fromkeys(OF_CHANNELS, JointState), **dict.fromkeys(DECISIONS + GROUPS, Bool)}


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


def test_rviz_subscribes_to_the_markers_as_they_are_published():
    layout = yaml.safe_load((CONFIG / 'slip.rviz').read_text())['Visualization Manager']
    (display,) = (each for each in layout['Displays'] if 'Topic' in each)
    assert display['Class'] == 'rviz_default_plugins/MarkerArray'
    assert display['Topic']['Value'] == '/slip_view/taxels'
    asked = ReliabilityPolicy[display['Topic']['Reliability Policy'].upper()]
    assert asked == event_qos().reliability


def check_plotted(curves):
    """Check that curves, each a topic, a field and a channel or None, are all that there is."""
    assert {topic for topic, *_ in curves} == OF_PLOTS.keys()
    for topic, field, _ in curves:
        assert field in OF_PLOTS[topic].get_fields_and_field_types()
    assert {(topic, 'position', name) for topic in OF_CHANNELS for name in NAMES} <= set(curves)


def test_plotjuggler_plots_what_is_published():
    layout = ElementTree.parse(CONFIG / 'slip.plotjuggler.xml').getroot()
    of_a_curve = re.compile(r'(?P<topic>/.+?)(?:/(?P<channel>ch\d+))?/(?P<field>\w+)')
    found = [of_a_curve.fullmatch(curve.get('name')) for curve in layout.iter('curve')]
    check_plotted([each.group('topic', 'field', 'channel') for each in found])


def test_foxglove_plots_what_is_published():
    layout = json.loads((CONFIG / 'slip.foxglove.json').read_text())
    curves = []
    for path in (path for each in layout['configById'].values() for path in each.get('paths', [])):
        assert path['enabled']
        if path['value'] == str(DetectorConfig().threshold):
            continue  # a line at this value
        topic, field, index = re.fullmatch(
            r'(/[\w/]+)\.(\w+)(?:\[(\d+)\])?', path['value']
        ).groups()
        curves.append((topic, field, index and NAMES[int(index)]))
        assert path['label'] == (curves[-1][2] or topic.rpartition('/')[2])
    check_plotted(curves)
