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

"""Whether figures are as wanted."""

from benchmarks.verdicts import verdict_in_words, verdicts
from slip_detector.evaluation.bounds import Bound


def test_a_claim_that_was_not_measured_is_neither_met_nor_not():
    bounds = {'a': Bound(high=1.0, strict=True), 'b': Bound(low=2.0), 'c': Bound(high=3.0)}
    assert verdicts(bounds, {'a': 1.0, 'b': 2.0, 'c': None}) == {
        'a': {'value': 1.0, 'bound': '< 1', 'met': False},
        'b': {'value': 2.0, 'bound': '>= 2', 'met': True},
        'c': {'value': None, 'bound': '<= 3', 'met': None},
    }


def test_a_measurement_that_was_too_short_is_not_judged():
    values = {'a': 2.0, 'b': None}
    bounds = {'a': Bound(high=1.0, strict=True), 'b': Bound(high=1.0, strict=True)}
    words = {
        judged: [verdict_in_words(entry) for entry in verdicts(bounds, values, judged).values()]
        for judged in (True, False)
    }
    assert words == {
        True: ['NOT met', 'not measured'],
        False: ['not judged', 'not measured'],
    }
