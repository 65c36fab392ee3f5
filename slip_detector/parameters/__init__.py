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

"""Parameters as fields of frozen dataclasses: one field is one parameter, everywhere.

The parameters of each node and command are a set, read from ROS parameter files and written to
them; what all sets share is :class:`ParameterSet` and :func:`parameter`. Here is also what other
rooms need for messages of errors, files and YAML. They import all of it from here.
"""

from slip_detector.parameters.chain import (
    COMMON_MODES,
    PAPER_CHANNELS,
    PAPER_GROUPS,
    ChainConfig,
    default_channel_names,
)
from slip_detector.parameters.detector import FIXED_PARAMETERS, NODE_PARAMETERS, DetectorConfig
from slip_detector.parameters.driver import DriverConfig, RecordingConfig
from slip_detector.parameters.evaluation import EvaluationConfig, TuneConfig
from slip_detector.parameters.fields import (
    Field,
    allowed,
    convert,
    name_list,
    names_that_affect,
    parameter,
    quote,
    quote_name,
    refuse,
    shortened,
    under_headings,
)
from slip_detector.parameters.files import (
    CACHE,
    check_plain,
    file_errors_of,
    find_parameter_file,
    shared_folder,
    whole_file,
    writable_folder,
)
from slip_detector.parameters.fitting import RATE_TOLERANCE, fitting, rates_differ
from slip_detector.parameters.grasp import (
    ACTIONS,
    GRIPPER_COMMAND,
    JOINT_STATE,
    GraspConfig,
    commands_of_a_scene,
)
from slip_detector.parameters.sections import (
    check_values,
    is_of_rclpy,
    parameter_file,
    parameters_for,
    sections_of,
)
from slip_detector.parameters.sets import ConfigType, ParameterSet
from slip_detector.parameters.yaml_files import as_yaml, parsed_yaml, read_yaml, write_yaml

__all__ = [
    'ACTIONS', 'CACHE', 'COMMON_MODES', 'FIXED_PARAMETERS', 'GRIPPER_COMMAND', 'JOINT_STATE',
    'NODE_PARAMETERS', 'PAPER_CHANNELS', 'PAPER_GROUPS', 'RATE_TOLERANCE', 'ChainConfig',
    'ConfigType', 'DetectorConfig', 'DriverConfig', 'EvaluationConfig', 'Field', 'GraspConfig',
    'ParameterSet', 'RecordingConfig', 'TuneConfig', 'allowed', 'as_yaml', 'check_plain',
    'check_values', 'commands_of_a_scene', 'convert', 'default_channel_names', 'file_errors_of',
    'find_parameter_file', 'fitting', 'is_of_rclpy', 'name_list', 'names_that_affect', 'parameter',
    'parameter_file', 'parameters_for', 'parsed_yaml', 'quote', 'quote_name', 'rates_differ',
    'read_yaml', 'refuse', 'sections_of', 'shared_folder', 'shortened', 'under_headings',
    'whole_file', 'writable_folder', 'write_yaml',
]  # fmt: skip
