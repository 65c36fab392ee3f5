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

"""The arguments that ``ros2 launch --show-args`` shows."""

from support.launching import defaults_of

OF_VIEW = {'namespace', 'configs', 'view', 'view_options', 'transport'}
OF_VIEW |= {'use_sim_time', 'log_level', 'use_respawn'}
ALL_FILES = OF_VIEW | {'config', 'source'}


def test_no_name_of_a_file_is_a_default():
    # It would also be that of a file in the folder in which somebody launches.
    assert defaults_of('slip_detector')['config'] == ''
    assert defaults_of('grasp')['config'].startswith('/')


def test_the_arguments_of_included_files_are_shown_too():
    own = {'fingers', 'recording', 'name', 'voltages'}
    assert defaults_of('slip_detector').keys() == ALL_FILES | own
    assert defaults_of('hand').keys() == defaults_of('slip_detector').keys()
    assert defaults_of('view').keys() == OF_VIEW
    assert defaults_of('grasp').keys() == ALL_FILES | {'scene', 'seed'}


def test_a_hand_has_five_fingers_unless_others_are_named():
    assert defaults_of('slip_detector')['fingers'] == ''
    assert defaults_of('hand')['fingers'] == 'thumb,index,middle,ring,little'
