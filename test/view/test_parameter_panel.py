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

"""Parameters as pages show them: what was typed, what changed, what is undone."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.parameter_panel import (
    OF_ROS,
    OUTSIDE,
    RESTART,
    ParameterPanel,
    Reading,
    text_of,
    typed,
    words_of,
)
from support.random_chains import configs

VALUES = {**DetectorConfig().to_parameters(), 'use_sim_time': False}
READ_ONLY = frozenset(['autostart'])


def panel_of(values=VALUES, file_values=None):
    panel = ParameterPanel(file_values)
    panel.read(Reading(values, READ_ONLY, {'use_sim_time': 'Whose clock it is.'}))
    return panel


@given(chain=configs())
def test_a_shown_value_typed_again_is_unchanged(chain):
    config = DetectorConfig(**vars(chain))
    retyped = {n: typed(n, text_of(v)) for n, v in config.to_parameters().items()}
    assert DetectorConfig.from_parameters(retyped) == config


@pytest.mark.parametrize(
    ('name', 'text', 'value'),
    [
        ('threshold', ' 0.5 ', 0.5),
        ('threshold', '1e-3', 1e-3),
        ('threshold', '', ''),
        ('threshold', '1.2.3', '1.2.3'),
        ('vote', 'all', 'all'),
        ('vote', '2', 2),
        ('publish_groups', 'true', True),
        ('input_field', '12', '12'),
        ('stopbands_hz', '[]', []),
        ('stopbands_hz', '0.5, 7', [0.5, 7]),
        ('groups.TP', '1, 2', [1, 2]),
        ('channel_names', 'a, 7', ['a', '7']),
        ('noise_floor', '0.1', [0.1]),
        ('of_another_node', '3', 3),
    ],
)
def test_typed_text_is_read_as_the_type_of_its_parameter(name, text, value):
    read = typed(name, text)
    assert read == value
    assert type(read) is type(value)


@given(name=st.sampled_from(list(VALUES)), text=st.text())
def test_the_detector_can_judge_any_typed_text(name, text):
    value = typed(name, text)
    if name in READ_ONLY or name == 'use_sim_time':
        return
    with contextlib.suppress(ValueError):  # whose words go to the page
        DetectorConfig.from_parameters({name: value})


def test_every_parameter_stands_under_the_heading_of_the_docs():
    parts = panel_of().shown()
    rows = {row['name']: row for part in parts for row in part['parameters']}
    assert rows.keys() == VALUES.keys()
    assert (parts[0]['heading'], parts[-1]['heading']) == ('Samples', OF_ROS)
    band, threshold = rows['passband_hz'], rows['threshold']
    assert (band['text'], band['unit'], threshold['allowed']) == ('7, 50', 'Hz', '1e-30 to 1e+30')
    assert rows['rectify']['choices'] == ['full', 'half']
    assert rows['publish_groups']['choices'] == ['true', 'false']
    assert rows['groups.TP']['meaning'].startswith('Channels (from 1) of each group')
    assert rows['use_sim_time']['meaning'] == 'Whose clock it is.'
    assert [name for name, row in rows.items() if row['read_only']] == ['autostart']


#: Changes of some parameters, some of which go and come.
CHANGES = st.lists(
    st.dictionaries(
        st.sampled_from(['threshold', 'gain', 'vote', 'groups.a', 'groups.b']),
        st.none() | st.integers(1, 3),
        min_size=1,
    ),
    max_size=8,
)


@given(changes=CHANGES)
def test_undoing_again_and_again_leads_back_through_every_state(changes):
    panel = panel_of({'threshold': 1, 'gain': 1, 'groups.a': 1})
    states = [panel.values]
    for values in changes:
        undoes = bool(panel.history) and panel.history[-1].before == {
            n: v for n, v in values.items() if panel.values.get(n) != v
        }
        if panel.update(values) is None:
            assert panel.values == states[-1]
        elif undoes:
            states.pop()
            assert panel.values == states[-1]
        else:
            states.append(panel.values)
    while panel.to_undo():
        assert panel.values == states.pop()
        panel.update(panel.to_undo())
    assert [panel.values] == states


def test_restoring_the_file_sets_all_that_differs_and_can_be_set():
    file_values = DetectorConfig(threshold=0.3, autostart=False).to_parameters()
    panel = panel_of(file_values=file_values)
    assert panel.as_in_file() == {'threshold': 0.3}
    panel.update({'groups.TP': None, 'groups.mine': [1], 'threshold': 0.3})
    wanted = panel.as_in_file()
    assert wanted == {'groups.TP': file_values['groups.TP'], 'groups.mine': None}
    panel.update(wanted)
    assert panel.as_in_file() == {}
    without_file = panel_of()
    without_file.update({'threshold': 0.3})
    assert without_file.as_in_file() == {'threshold': 0.5}


def test_values_lost_in_a_restart_are_reported_and_can_be_set_again_by_undo():
    panel = panel_of()
    panel.update({'threshold': 0.3})
    again = {**VALUES, 'autostart': False}
    change = panel.read(Reading(again, READ_ONLY, {}))
    assert change.by == RESTART
    assert words_of(change) == 'threshold from 0.3 to 0.5, autostart from true to false'
    assert panel.to_undo() == {'threshold': 0.3}
    panel.update(panel.to_undo())
    assert panel.values['threshold'] == 0.3
    assert panel.to_undo() == {'threshold': 0.5}
    assert panel.read(Reading(panel.values, READ_ONLY, {})) is None


def test_a_change_is_attributed_to_the_page_that_asked():
    panel = panel_of()
    panel.expect({'threshold': 0.3, 'gain': 1.0}, 'page 1')
    panel.expect({'vote': 'mean'}, 'page 2')
    panel.expect({'exponent': 7}, 'page 2')
    panel.refused({'exponent': 7}, 'page 2')
    told = [
        panel.update(values).by
        for values in (
            {'threshold': 0.2},
            {'gain': 1.0, 'threshold': 0.3},
            {'gain': 2.0, 'threshold': 0.4},
            {'exponent': 2},
        )
    ]
    # As all of them are read.
    told.append(panel.update({**panel.values, 'vote': 'mean'}).by)
    assert told == [OUTSIDE, 'page 1', OUTSIDE, OUTSIDE, 'page 2']
    assert [change.by for change in panel.changes] == told


@pytest.mark.parametrize('refused', [(), (1,), (2,), (1, 2)])
def test_two_pages_that_change_the_same_parameter_at_once_are_told_apart(refused):
    panel = panel_of()
    asked = {1: {'threshold': 0.2}, 2: {'threshold': 0.3}, 3: {'threshold': 0.4}}
    for page, values in asked.items():
        panel.expect(values, f'page {page}')
    for page in refused:
        panel.refused(asked[page], f'page {page}')
    told = {page: panel.update(v).by for page, v in asked.items() if page not in refused}
    assert told == {page: f'page {page}' for page in asked if page not in refused}
    assert panel.update({'threshold': 0.5}).by == OUTSIDE


def test_a_rounded_value_is_attributed_to_the_last_page_that_asked():
    panel = panel_of()
    panel.expect({'threshold': 0.3}, 'page 1')
    assert panel.update({'threshold': 0.30000001}).by == 'page 1'
    panel.expect({'threshold': 0.3}, 'page 1')
    panel.read(Reading(panel.values, READ_ONLY, {}))  # The detector that was asked has ended.
    assert panel.update({'threshold': 0.3}).by == OUTSIDE
    panel.expect({'threshold': 0.2}, 'page 1')  # Its event is lost.
    panel.expect({'threshold': 0.4}, 'page 2')
    assert panel.update({'threshold': 0.4}).by == 'page 2'
    assert panel.update({'threshold': 0.5}).by == OUTSIDE


def test_a_long_list_is_shortened_in_words():
    panel = panel_of()
    change = panel.update({'noise_floor': [0.125] * 1000, 'groups.TP': None})
    words = words_of(change)
    assert words.startswith('noise_floor from empty to 0.125, 0.125')
    assert words.endswith('groups.TP from 14, 16, 11, 9 to nothing')
    assert len(words) < 400
