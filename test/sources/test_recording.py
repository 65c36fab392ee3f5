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

"""A recording as a source: every cut of it gives the same samples."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings import npz_recording, write_recording
from slip_detector.sources import open_source
from slip_detector.sources.recording import RecordingSource

N_ROWS = 50


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    rng = np.random.default_rng(0)
    path = tmp_path_factory.mktemp('whole') / 'a.npz'
    volts, slip = rng.normal(size=(N_ROWS, 3)), rng.random(N_ROWS) > 0.5
    np.savez(path, volts=volts, slip=slip, sample_rate_hz=60.0)
    return path, volts, slip


@given(st.lists(st.integers(0, N_ROWS + 5), max_size=20))
@pytest.mark.parametrize('piece_rows', [7, 8192])
def test_a_recording_is_read_to_its_end_in_any_cut(whole, piece_rows, cuts):
    path, volts, slip = whole
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(npz_recording, 'PIECE_ROWS', piece_rows)
        source = RecordingSource(DriverConfig(recording=str(path)))
        pieces = [source.read(n) for n in [*cuts, N_ROWS, 1]]
    np.testing.assert_array_equal(np.concatenate([p.volts for p in pieces]), volts)
    truth = [p.truth for p in pieces if p.truth is not None]
    np.testing.assert_array_equal(np.concatenate(truth), slip)
    stamps_ns = np.concatenate([p.stamps_ns for p in pieces])
    np.testing.assert_array_equal(stamps_ns, np.rint(np.arange(N_ROWS) * 1e9 / 60.0))
    assert all(len(p.volts) <= n for p, n in zip(pieces, [*cuts, N_ROWS, 1], strict=True))
    whole_cuts = [len(p.volts) == n for p, n in zip(pieces, cuts, strict=False)]
    assert all(whole_cuts) or sum(cuts) > N_ROWS
    assert len(pieces[-1].volts) == 0


def test_a_recording_tells_its_damage_when_it_was_read(tmp_path):
    pytest.importorskip('rosbags', reason='needs rosbags')
    path = tmp_path / 'a.mcap'
    samples = Samples(np.full((N_ROWS, 2), 4.0), 2_000_000 * np.arange(1, N_ROWS + 1))
    write_recording(path, [samples], 500.0, ['a', 'b'])

    def damage():
        source = RecordingSource(DriverConfig(recording=str(path)))
        source.read(N_ROWS + 1)
        return source.damage

    assert damage() == ''
    path.write_bytes(path.read_bytes()[:4000])
    assert damage().startswith('a.mcap is cut off at byte 4000')


def test_a_recording_without_label_plays_without_truth_and_without_platform(tmp_path):
    np.savez(tmp_path / 'a.npz', volts=np.ones((9, 2)), sample_rate_hz=60.0)
    samples = RecordingSource(DriverConfig(recording=str(tmp_path / 'a.npz'))).read(5)
    assert samples.truth is None
    assert samples.position_m is None


def test_a_recording_plays_under_its_own_rate_and_names(tmp_path):
    path = tmp_path / 'a.csv'
    path.write_text('time_s,left,slip,right\n0,1,0,2\n0.5,3,1,4\n')
    source = open_source(DriverConfig(source='recording', recording=str(path)))
    assert source.sample_rate_hz == 2.0
    assert source.channel_names == ('left', 'right')
    samples = source.read(10)
    np.testing.assert_array_equal(samples.volts, [[1, 2], [3, 4]])
    np.testing.assert_array_equal(samples.truth, [False, True])


def test_a_recording_is_opened_with_the_configured_keys(tmp_path):
    path = tmp_path / 'a.npz'
    np.savez(path, tactile=[[1.0], [2.0]], fs=60.0)
    config = DriverConfig(
        source='recording',
        recording=str(path),
        recording_volts_key='tactile',
        recording_rate_key='fs',
    )
    np.testing.assert_array_equal(open_source(config).read(9).volts, [[1.0], [2.0]])


def test_a_recording_repeats_to_the_bit(tmp_path):
    path = tmp_path / 'a.npz'
    np.savez(path, volts=np.random.default_rng(0).normal(size=(9, 2)), sample_rate_hz=60.0)
    config = DriverConfig(source='recording', recording=str(path))
    first, again = (open_source(config, repetition).read(9).volts for repetition in (0, 1))
    assert first.tobytes() == again.tobytes()


def test_a_missing_recording_is_named(tmp_path):
    path = tmp_path / 'no.npz'
    with pytest.raises(ValueError, match=re.escape(f'{path}: cannot be read')):
        open_source(DriverConfig(source='recording', recording=str(path)))


def test_a_recording_without_a_path_is_an_error_that_says_why():
    with pytest.raises(ValueError, match="parameter recording is '', allowed: a path, as source"):
        open_source(DriverConfig(source='recording'))
