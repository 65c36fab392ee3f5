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

"""The description of a parameter."""

import dataclasses

from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.parameters.fields import allowed, default_of, under_headings


def test_the_default_of_groups_is_not_shared():
    field = next(f for f in dataclasses.fields(ChainConfig) if f.name == 'groups')
    default_of(field)['mine'] = (1,)
    assert 'mine' not in default_of(field)
    assert 'mine' not in ChainConfig().groups


def test_allowed_says_the_range_the_choices_or_nothing():
    fields = {field.name: field for field in dataclasses.fields(DriverConfig)}
    chain = {field.name: field for field in dataclasses.fields(ChainConfig)}
    assert allowed(chain['sample_rate_hz']) == '1 to 1e+06 Hz'
    assert allowed(chain['rectify']) == 'full, half'
    assert allowed(fields['frame_id']) == ''


def test_each_field_stands_under_the_heading_before_it_in_the_order_of_the_set():
    found = under_headings(DetectorConfig)
    names = [field.name for fields in found.values() for field in fields]
    assert names == [field.name for field in dataclasses.fields(DetectorConfig)]
    assert next(iter(found)) == 'Samples'
    assert {field.name for field in found['Threshold and vote']} == {'threshold', 'vote', 'groups'}
    assert '' not in found
    assert list(under_headings(DriverConfig)) == ['']
