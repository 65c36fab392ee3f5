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

"""What the tests of parameters share."""

import pytest

from slip_detector.parameters import ChainConfig, RecordingConfig
from slip_detector.parameters.sections import SECTIONS, set_of

SETS = (ChainConfig, RecordingConfig, *map(set_of, SECTIONS))


def message_of(build, *args, **values):
    """Return the text of the ValueError, which is one line."""
    with pytest.raises(ValueError, match=r'\S') as caught:
        build(*args, **values)
    # Not one of its children, such as a UnicodeDecodeError.
    assert type(caught.value) is ValueError
    message = str(caught.value)
    assert '\n' not in message
    return message
