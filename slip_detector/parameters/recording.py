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

"""The parameters that describe a recording."""

import dataclasses

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet


@dataclasses.dataclass(frozen=True)
class RecordingConfig(ParameterSet):
    """Where in a recording the samples and the labels are, and how they are read.

    The driver, the evaluation and the tuner read these parameters from the section ``slip_driver``
    of a parameter file.

    Examples
    --------
    >>> RecordingConfig(recording_topic='/left/voltages').recording_volts_key
    'volts'
    """

    NODE = 'slip_driver'

    recording_topic: str = parameter(
        '', 'Topic of a bag that has the samples; empty: voltages in any namespace.'
    )
    recording_field: str = parameter(
        '',
        'Field of its messages that has the channels, such as pac or pillars[].fz; empty: '
        'position of a JointState, data of a MultiArray.',
    )
    recording_labels: str = parameter(
        '',
        'YAML file of the intervals with slip, or a folder of such files; empty: '
        '<name>.labels.yaml beside the recording, if it exists.',
    )
    recording_truth_topic: str = parameter(
        'slip_truth', 'Topic of a bag with the true slip (Bool, on change).'
    )
    recording_position_topic: str = parameter(
        'platform_position',
        'Topic of a bag with a position that changes while there is slip (Eq. 9); used if the bag '
        'has no topic of true slip.',
    )
    recording_still_m: float = parameter(
        0.0,
        'Largest change of that position from one message to the next that counts as rest.',
        unit='m',
        low=0.0,
        high=1.0,
    )
    recording_resample: bool = parameter(
        False,
        'Whether slip_evaluate and slip_tune resample a recording to the rate of the chain; the '
        'driver plays it at its own rate.',
    )
    recording_limit_mb: float = parameter(
        1024.0,
        'Largest array, chunk or piece of a recording that is held in memory; reading needs at '
        'most four times as much.',
        unit='MB',
        low=1.0,
        high=1e6,
    )
    recording_volts_key: str = parameter('volts', 'Name of the array of rows in an npz recording.')
    recording_rate_key: str = parameter(
        'sample_rate_hz', 'Name of the sample rate in an npz recording.'
    )
    recording_truth_key: str = parameter(
        'slip', 'Name of the column or array of true slip; absent: no truth is published.'
    )
