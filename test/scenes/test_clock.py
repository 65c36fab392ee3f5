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

"""The clock: its ratio is checked; what it does is in the tests of the scene."""

import pytest

from slip_detector.scenes.faults import Clock
from support.disturbance_cases import check_refused


@pytest.mark.parametrize(('ratio', 'shown'), [(0, '0'), (0.09, '0.09'), (11, '11'), (-1.0, '-1')])
def test_a_ratio_that_is_not_allowed_is_named_with_what_is(ratio, shown):
    said = f'parameter rate_ratio is {shown}, allowed: 0.1 to 10'
    check_refused(Clock, {'rate_ratio': ratio}, said)


def test_parameters_survive_being_written_and_read():
    part = Clock(rate_ratio=0.97)
    assert type(part).from_parameters(part.to_parameters()) == part
