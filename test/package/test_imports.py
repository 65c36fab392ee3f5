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

"""What may import what."""

import functools
import json
import pkgutil

import pytest

import slip_detector
from support.pages import ROOT
from support.python_runs import run_python

#: Imported only where a bag is written, as it needs rosbags.
WITH_ROSBAGS = 'slip_detector.recordings.bag_files'

CORE = tuple(
    sorted(
        module.name
        for module in pkgutil.walk_packages(slip_detector.__path__, 'slip_detector.')
        if not module.name.startswith(('slip_detector.nodes', WITH_ROSBAGS))
    )
)
NODES = tuple(
    f'slip_detector.nodes.{name}'
    for name in ('detector', 'driver', 'grasp_controller', 'spinning')
)

ROS = {'rclpy', 'std_msgs', 'sensor_msgs', 'rcl_interfaces', 'builtin_interfaces'}
ROS |= {'diagnostic_msgs', 'geometry_msgs', 'lifecycle_msgs', 'visualization_msgs'}

#: Modules that are imported one group after the other: the chain, all without reports, and all.
GROUPS = (
    ('slip_detector.chain.slip_chain', 'slip_detector.parameters.detector'),
    tuple(name for name in CORE if not name.startswith('slip_detector.report.')),
    CORE,
)

IMPORT = """
import gc, importlib, json, sys
gc.disable()
loaded = []
for modules in {groups!r}:
    for name in modules:
        importlib.import_module(name)
    loaded.append(sorted(sys.modules))
print(json.dumps(loaded))
"""


@functools.cache
def loaded_by(*groups):
    """Import groups of modules in a new interpreter; return all that is loaded after each."""
    done = run_python('-c', IMPORT.format(groups=groups), cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return [set(loaded) for loaded in json.loads(done.stdout)]


def test_only_nodes_import_rclpy_and_messages_and_only_bags_what_reads_them():
    loaded = loaded_by(*GROUPS)[-1]
    assert loaded > {*CORE, 'slip_detector.recordings.bag_recording'}
    assert loaded.isdisjoint({*ROS, 'rosbags'})


def test_only_the_report_imports_a_plotting_library():
    _, others, core = loaded_by(*GROUPS)
    assert 'matplotlib' in core - others


def test_the_chain_loads_nothing_that_it_does_not_need():
    loaded = loaded_by(*GROUPS)[0]
    assert 'numpy' in loaded
    # Signal takes long to load, and only a process that designs a filter needs it.
    assert loaded.isdisjoint({*ROS, 'matplotlib', 'optuna', 'rosbags', 'scipy.signal'})


def test_the_nodes_load_neither_plotting_nor_reports_nor_a_serial_port():
    pytest.importorskip('rclpy', reason='needs rclpy')
    (loaded,) = loaded_by(NODES)
    of_reports = {f'slip_detector.report.{name}' for name in ('overview', 'page', 'pictures')}
    assert loaded.isdisjoint({*of_reports, 'matplotlib', 'serial'})
