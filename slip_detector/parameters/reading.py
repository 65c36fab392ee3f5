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

# ruff: noqa: PLC0414
"""Moved to sets and files."""

from slip_detector.parameters.files import read_yaml as read_yaml
from slip_detector.parameters.sets import OF_RCLPY as OF_RCLPY
from slip_detector.parameters.sets import SECTIONS as SECTIONS
from slip_detector.parameters.sets import check_sections as check_sections
from slip_detector.parameters.sets import matches as matches
from slip_detector.parameters.sets import names_for_others as names_for_others
from slip_detector.parameters.sets import node_of as node_of
from slip_detector.parameters.sets import nodes_that_know as nodes_that_know
from slip_detector.parameters.sets import our_sections as our_sections
from slip_detector.parameters.sets import read_parameter_file as read_parameter_file
from slip_detector.parameters.sets import sections_of as sections_of
