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

"""Recordings are opened, checked, read in pieces with their labels, and evaluated."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from slip_detector.evaluation.evaluator import (
    MISTAKEN,
    RecordingLoader,
    evaluate_recording,
    recording_figures,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.recordings.labels import mark_mistaken

CHAIN = ChainConfig(channels=2, stopbands_hz=(), gain=1.0, threshold=0.1)
RATE_HZ = CHAIN.sample_rate_hz


def arrays(seed, rows=800):
    slip = np.arange(rows) % 400 >= 300
    volts = np.random.default_rng(seed).normal(size=(rows, 2))
    return volts * np.where(slip, 1.0, 0.05)[:, np.newaxis], slip


def write(path, seed=0, rows=800, **changes):
    volts, slip = arrays(seed, rows)
    np.savez(path, **{'volts': volts, 'slip': slip, 'sample_rate_hz': RATE_HZ, **changes})
    return path


def loader(chain=CHAIN, resample=False, **evaluation):
    recording = RecordingConfig(recording_resample=resample)
    return RecordingLoader(chain, recording, EvaluationConfig(**evaluation))


def whole(labelled):
    """Put the pieces of a recording together."""
    first, *others = labelled.rows
    return first.then(*others)


def test_a_recording_without_labels_has_no_slip_where_none_are_required(tmp_path):
    path = tmp_path / 'a.npz'
    np.savez(path, volts=np.zeros((9, 2)), sample_rate_hz=RATE_HZ)
    assert not whole(loader().open(path, require_truth=False)).truth.any()
    with pytest.raises(ValueError, match=f'^{path}: has no label slip, there are: sample_rate_hz'):
        loader().open(path)


def test_a_recording_without_labels_has_decisions_and_leaves_the_scores_as_they_are(tmp_path):
    one = evaluate_recording(loader(), write(tmp_path / 'a.npz'))
    volts, _ = arrays(1)
    volts[5:8, 1] = np.nan
    np.savez(tmp_path / 'bare.npz', volts=volts, sample_rate_hz=RATE_HZ)
    bare = evaluate_recording(loader(), tmp_path / 'bare.npz')
    alone, of_bare, both = map(recording_figures, ([one], [bare], [one, bare]))
    decided = ('rows', 'duration_s', 'onsets', 'on_s')
    faults = ('bad_samples', 'gaps', 'bridged_rows', 'long_gaps', 'dropped')
    assert of_bare['onsets'] > 0
    assert (of_bare['bad_samples'], of_bare['invalid_channels']) == (3, 1)
    summed = *decided, *faults
    assert [both[name] for name in summed] == [alone[name] + of_bare[name] for name in summed]
    others = {*alone} - {*summed, 'onsets_per_minute', 'on_percent', 'invalid_channels'}
    assert {both[name] == alone[name] for name in others} == {True}
    undefined = {name for name in others if of_bare[name] is None}
    assert others == undefined


@pytest.mark.parametrize('by_hand', ['', '{slip_s: [[1, 2]], accuracy_s: 0.05}', 'kind: rest'])
def test_labels_that_are_marked_as_a_mistake_are_in_no_score_until_the_mark_is_gone(
    tmp_path, by_hand
):
    path, file = write(tmp_path / 'a.npz'), tmp_path / 'a.labels.yaml'
    if by_hand:
        file.write_text(by_hand)
    before = recording_figures([evaluate_recording(loader(), path)])
    mark_mistaken(path, True)
    marked = evaluate_recording(loader(), path)
    assert recording_figures([marked])['slips'] is None
    assert marked.warnings == [f'{MISTAKEN}, so in no figure']
    with pytest.raises(ValueError, match=f'^{path}: {MISTAKEN}$'):
        loader().open(path)
    mark_mistaken(path, False)
    assert file.exists() == bool(by_hand)
    assert recording_figures([evaluate_recording(loader(), path)]) == before


def test_a_recording_of_another_rate_has_the_rows_and_rate_of_the_chain(tmp_path):
    path = write(tmp_path / 'a.npz', sample_rate_hz=2 * RATE_HZ)
    opened = loader(resample=True).open(path)
    assert opened.sample_rate_hz == RATE_HZ
    assert len(whole(opened).volts) == pytest.approx(400, abs=1)


def test_other_channels_and_names_are_refused_and_a_recording_without_names_is_not(tmp_path):
    three, named = ChainConfig(channels=3), replace(CHAIN, channel_names=('a', 'b'))
    path = tmp_path / 'a.csv'
    path.write_text('time_s,a,c,slip\n0,1,2,0\n0.00263,1,2,0\n')
    for chain, said in (
        (three, 'has 2 channels, allowed: 3, the parameter channels'),
        (named, 'has the channels a, c, allowed: a, b, the parameter channel_names'),
    ):
        with pytest.raises(ValueError, match=f'^{path}: {said}$') as refused:
            loader(chain).open(path)
        # It has the content of a file with which it is opened.
        advised = tmp_path / 'my_sensor.yaml'
        advised.write_text(refused.value.advice)
        assert whole(loader(ChainConfig.from_yaml(advised)).open(path)).volts.shape == (2, 2)
    assert len(whole(loader(named).open(write(tmp_path / 'a.npz'))).volts) == 800


@given(
    velocities=hnp.arrays(np.float64, (40, 3), elements=st.floats(-1.0, 1.0)),
    columns=st.lists(st.sampled_from('xyz'), unique=True),
)
def test_a_row_is_one_of_motion_where_the_speed_of_the_named_columns_is_above_the_limit(
    tmp_path_factory, velocities, columns
):
    path = tmp_path_factory.mktemp('motion') / 'a.npz'
    write(path, rows=40, v=velocities, v_names=list('xyz'))
    opened = loader(motion_key='v', motion_columns=tuple(columns), moving_above=0.5).open(path)
    which = ['xyz'.index(name) for name in columns] or [0, 1, 2]
    speed = np.linalg.norm(velocities[:, which], axis=1)
    np.testing.assert_array_equal(whole(opened).moving, speed > 0.5)


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'v': None}, 'has no array v, there are: sample_rate_hz, slip, v_names, volts$'),
        ({'v': np.zeros((40, 3, 1))}, r'v has the shape \(40, 3, 1\) and type float64, '),
        ({'v': np.full((40, 3), np.nan)}, r'v has the shape \(40, 3\) and type float64, '),
        ({'v_names': list('xx')}, r"v_names has the names \['x', 'x'\], allowed: one for "),
        ({'v_names': list('xxz')}, r"v_names has .*, with each of \['x', 'z'\] once$"),
        ({'v': np.zeros((50, 3))}, r'v has the shape \(50, 3\) .* number for each of 40 rows$'),
    ],
)  # fmt: skip
def test_velocities_that_do_not_suit_are_refused(tmp_path, changes, message):
    arrays = {'v': np.zeros((40, 3)), 'v_names': list('xyz'), **changes}
    path = tmp_path / 'a.npz'
    write(path, rows=40, **{name: one for name, one in arrays.items() if one is not None})
    with pytest.raises(ValueError, match=f'^{path}: {message}'):
        whole(loader(motion_key='v', motion_columns=('x', 'z')).open(path))
