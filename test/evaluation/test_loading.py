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

"""Recordings are opened, seen to suit the chain, and read in pieces with their labels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.recording import RecordingConfig

CHAIN = ChainConfig(channels=2, stopbands_hz=())
RATE_HZ = CHAIN.sample_rate_hz


def write(path, rows=500, **more):
    volts = np.random.default_rng(0).normal(size=(rows, 2))
    arrays = {'volts': volts, 'slip': np.arange(rows) > rows // 2, 'sample_rate_hz': RATE_HZ}
    np.savez(path, **{**arrays, **more})
    return path


def loader(chain=CHAIN, resample=False, **evaluation):
    recording = RecordingConfig(recording_resample=resample)
    return RecordingLoader(chain, recording, EvaluationConfig(**evaluation))


def whole(labelled):
    """Put the pieces of a recording together."""
    first, *others = labelled.rows
    return first.then(*others)


def test_the_rows_are_those_of_the_file_with_its_label(tmp_path):
    path = write(tmp_path / 'a.npz')
    labelled = loader().open(path)
    assert (labelled.sample_rate_hz, labelled.channel_names) == (RATE_HZ, ('ch1', 'ch2'))
    rows = whole(labelled)
    with np.load(path) as file:
        np.testing.assert_array_equal(rows.volts, file['volts'])
        np.testing.assert_array_equal(rows.truth, file['slip'])
    assert rows.moving is None
    assert labelled.recording.counts.rows == 500


def test_a_recording_without_labels_has_no_slip_where_none_are_required(tmp_path):
    path = tmp_path / 'a.npz'
    np.savez(path, volts=np.zeros((9, 2)), sample_rate_hz=RATE_HZ)
    assert not whole(loader().open(path, require_truth=False)).truth.any()
    with pytest.raises(ValueError, match=f'^{path}: has no label slip, there are: sample_rate_hz'):
        loader().open(path)


def test_a_recording_of_another_rate_has_the_rows_and_rate_of_the_chain(tmp_path):
    path = write(tmp_path / 'a.npz', rows=1000, sample_rate_hz=2 * RATE_HZ)
    labelled = loader(resample=True).open(path)
    assert labelled.sample_rate_hz == RATE_HZ
    assert len(whole(labelled).volts) == pytest.approx(500, abs=1)
    with pytest.raises(ValueError, match=f'^{path}: has 760 Hz where the parameter sample_rate_h'):
        list(loader().open(path).rows)


def test_a_rate_that_hardly_differs_stays_that_of_the_recording(tmp_path):
    path = write(tmp_path / 'a.npz', sample_rate_hz=1.01 * RATE_HZ)
    labelled = loader().open(path)
    assert labelled.sample_rate_hz == 1.01 * RATE_HZ
    assert len(whole(labelled).volts) == 500


def test_other_channels_than_those_of_the_chain_are_refused(tmp_path):
    path = write(tmp_path / 'a.npz')
    with pytest.raises(
        ValueError, match=f'^{path}: has 2 channels, allowed: 3, the parameter cha'
    ):
        loader(ChainConfig(channels=3, stopbands_hz=())).open(path)


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
