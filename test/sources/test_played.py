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

"""Recordings and scenes as sources."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings import array_recordings
from slip_detector.sources import open_source
from slip_detector.sources.played import RecordingSource

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
        patch.setattr(array_recordings, 'PIECE_ROWS', piece_rows)
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


def test_a_recording_that_is_left_in_the_middle_is_closed(tmp_path, monkeypatch):
    monkeypatch.setattr(array_recordings, 'PIECE_ROWS', 3)
    path = tmp_path / 'a.csv'
    path.write_text('time_s,a\n' + ''.join(f'{0.01 * k:.2f},1\n' for k in range(N_ROWS)))

    def is_open():
        return str(path) in map(os.path.realpath, Path('/proc/self/fd').iterdir())

    source = RecordingSource(DriverConfig(recording=str(path)))
    source.read(5)
    assert is_open()
    source.close()
    assert not is_open()


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        ({'source': 'recording'}, "parameter recording is '', allowed: a path, as source is"),
        ({'source': 'recording', 'recording': __file__}, 'is .py, allowed: .npz, .csv'),
        ({'source': 'scene', 'scene': 'moon'}, "'moon'.* plate_400um"),
        ({'source': 'scene', 'wait_for_grip': True}, 'allowed: a scene with an object, as wait'),
        ({}, 'parameter source is not given, allowed: scene'),
    ],
)
def test_a_source_that_cannot_be_played_is_an_error_that_says_why(parameters, message):
    with pytest.raises(ValueError, match=message):
        open_source(DriverConfig(**parameters))
