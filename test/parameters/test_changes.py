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

"""Changes of a configuration in use, one by one and whole files."""

import random

import pytest

from slip_detector.parameters import DetectorConfig
from slip_detector.parameters.changes import WAIT_S, Judge, changed
from slip_detector.parameters.files import shared_folder
from slip_detector.parameters.sections import parameters_for
from support.config_cases import message_of

FILES = {path.stem: path for path in sorted((shared_folder() / 'config').glob('*.yaml'))}

ORDERS = {
    'as written': list,
    'in reverse': lambda values: [*reversed(values)],
    'as dumped': sorted,
    'shuffled': lambda values: random.Random(len(values)).sample(values, len(values)),
}


def judge():
    return Judge(lambda config: None)


def test_only_groups_can_be_deleted():
    said = 'parameter threshold cannot be deleted, allowed: groups.<name>'
    assert message_of(changed, DetectorConfig(), {'threshold': None}) == said


@pytest.mark.parametrize('order', ORDERS)
@pytest.mark.parametrize('new', FILES)
@pytest.mark.parametrize('old', FILES)
def test_each_file_is_loaded_onto_each_other_as_a_whole_or_not_at_all(old, new, order):
    config = DetectorConfig.from_yaml(FILES[old])
    values = ORDERS[order]([*parameters_for(FILES[new], 'slip_detector')[0].items()])
    taken, refusals = judge().judged(config, values, 0.0)
    # The file says nothing of what another sensor needed: it stays as it was, and does not fit.
    if (old, new) != ('xela_uskin', 'xela_uskin') and old == 'xela_uskin':
        assert (taken, {*refusals}) == ({}, {refusals[0]})
        assert 'not yet' in refusals[0]
        return
    assert not any(refusals)
    loaded = DetectorConfig.from_yaml(FILES[new])
    now = changed(config, taken)
    assert {name: getattr(now, name.split('.')[0]) for name, _ in values} == {
        name: getattr(loaded, name.split('.')[0]) for name, _ in values
    }
    # One after the other, as some clients send them, they come to the same.
    one_by_one, now_s = judge(), 0.0
    for each in values:
        now_s += WAIT_S / 2
        taken, _ = one_by_one.judged(config, [each], now_s)
        config = changed(config, taken)
    assert config == now


def test_what_is_wrong_by_itself_is_refused_alone_and_the_last_of_a_name_counts():
    given = [('threshold', 0.7), ('vote', 'some'), ('vote', 'mean'), ('threshold', -1), ('a', 1)]
    taken, refusals = judge().judged(DetectorConfig(), given, 0.0)
    assert taken == {'threshold': 0.7, 'vote': 'mean'}
    assert [bool(refusal) for refusal in refusals] == [False, True, False, True, True]
    assert refusals[3] == 'parameter threshold is -1, allowed: 1e-30 to 1e+30'


@pytest.mark.parametrize(
    ('later_s', 'together'),
    [(0.9, {'decision': 'evidence', 'noise_floor': 1.0}), (1.1, {'noise_floor': 1.0})],
)
def test_what_does_not_fit_is_told_and_waits_for_a_while_only(later_s, together):
    config, one = DetectorConfig(), judge()
    (refusal,) = one.judged(config, [('decision', 'evidence')], 0.0)[1]
    assert refusal.startswith('parameter noise_floor has 0 numbers, allowed: one number, or 16')
    assert refusal.endswith(' (not yet: it waits 0.5 s for others)')
    # What has nothing to do with it is taken meanwhile.
    assert one.judged(config, [('gain', 2.0)], 0.4) == ({'gain': 2.0}, [''])
    assert one.judged(config, [('noise_floor', 1.0)], 0.4 + later_s * WAIT_S) == (together, [''])
