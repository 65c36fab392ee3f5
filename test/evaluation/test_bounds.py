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

"""A bound says which figures meet it."""

import pytest

from slip_detector.evaluation.bounds import Bound


@pytest.mark.parametrize(
    ('bound', 'text', 'met', 'missed'),
    [
        (Bound(low=1.0), '>= 1', [1.0, 5.0], [0.9]),
        (Bound(high=1.01), '<= 1.01', [1.01, -1.0], [1.02]),
        (Bound(low=0.0, strict=True), '> 0', [1e-9], [0.0, -1.0]),
        (Bound(high=1e7, strict=True), '< 1e+07', [9e6], [1e7, 2e7]),
        (Bound(1.0, 2.0), '1.00 to 2.00', [1.0, 2.0], [0.9, 2.1]),
    ],
)
def test_a_bound_is_met_or_missed_and_missed_by_what_is_not_defined(bound, text, met, missed):
    assert str(bound) == text
    assert all(bound.met(value) for value in met)
    assert not any(bound.met(value) for value in [*missed, None])
