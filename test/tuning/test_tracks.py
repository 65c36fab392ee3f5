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

"""Recordings in memory: how they are read, their time, their parts, and what is held out."""

import numpy as np
import pytest

from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.evaluation.scores import SLIP
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.tuning.tracks import (
    TUNED_SHARE,
    TrainingFiles,
    faults_of,
    hold_out_tracks,
    load_tracks,
)
from support.tuning_cases import CHAIN, slips, track, write


def names_of(*parts):
    return [[one.name for one in part] for part in parts]


def test_every_third_recording_is_held_out_of_those_with_slips_and_of_each_kind():
    tracks = [track(k) for k in range(5)] + [track(5, slips=False), track(6, slips=False)]
    parts = hold_out_tracks([*tracks, track(7, 'press'), track(8, 'press')])
    held = [f'seed {k}' for k in (1, 4, 6, 8)]
    training = [f'seed {k}' for k in (0, 2, 3, 5, 7)]
    assert names_of(*parts) == [training, held]


def test_one_recording_is_cut_between_two_slips():
    whole = track(3, duration_s=30.0)
    (training,), (held,) = hold_out_tracks([whole])
    assert len(training.slips) + len(held.slips) == len(whole.slips) == 10
    assert abs(training.duration_s - TUNED_SHARE * whole.duration_s) < 3.0
    np.testing.assert_array_equal(np.concatenate([training.volts, held.volts]), whole.volts)


LOADER = RecordingLoader(CHAIN, RecordingConfig(recording_truth_key='label'), EvaluationConfig())


@pytest.fixture
def folder(tmp_path):
    for seed, name in enumerate('abc'):
        write(tmp_path / f'{name}.npz', seed)
    return tmp_path


def test_tracks_hold_the_rows_and_slips_of_their_files(folder):
    track, *others = load_tracks([str(folder)], LOADER)
    volts, truth = slips(0)
    np.testing.assert_array_equal(track.volts, volts)
    np.testing.assert_array_equal(track.row_classes == SLIP, truth)
    assert [one.name for one in others] == ['b.npz', 'c.npz']
    assert track.samples.names == tuple(f'ch{k + 1}' for k in range(volts.shape[1]))
    volts[5, 0] = np.nan
    np.savez(folder / 'd.npz', volts=volts, label=truth, sample_rate_hz=380.0)
    found = load_tracks([str(folder)], LOADER)
    assert faults_of(found) == ['d.npz: 1 bad samples']


def test_those_named_are_held_out(folder):
    link = folder.parent / f'{folder.name}_link.npz'
    link.symlink_to(folder / 'a.npz')
    training, held, _ = TrainingFiles([str(folder)], LOADER, [str(link)]).load()
    assert names_of(training, held) == [['b.npz', 'c.npz'], [link.name]]


def test_what_cannot_be_used_is_left_out_with_a_line_and_what_is_not_there_is_refused(folder):
    np.savez(folder / 'aa.npz', volts=np.zeros((99, 3)), label=np.zeros(99), sample_rate_hz=380.0)
    write(folder / 'ab.npz', 1, slips=False)
    (folder / 'ab.labels.yaml').write_text('{slip_s: [], accuracy_s: 0.35}')
    training, held, notes = TrainingFiles([str(folder)], LOADER).load()
    assert names_of(training, held) == [['a.npz', 'c.npz'], ['b.npz']]
    assert notes == [
        f'Left out: {folder}/aa.npz: has 3 channels, allowed: 4, the parameter channels',
        f'Left out: {folder}/ab.npz: has no slip, allowed: one at least where labels are by hand',
    ]
    for paths, line in (
        ([folder / 'aa.npz'], r'^no recording: too few slips, .* Left out: .*/aa\.npz'),
        ([folder, folder / 'nix.npz'], r'nix\.npz: '),
    ):
        with pytest.raises(ValueError, match=line):
            TrainingFiles([*map(str, paths)], LOADER).load()


def test_more_recordings_may_be_of_a_kind_without_labels(folder, tmp_path_factory):
    presses = tmp_path_factory.mktemp('presses')
    for seed in (4, 5):
        write(presses / f'{seed}.npz', seed, label=False, slips=False)

    def load(kind, path):
        files = TrainingFiles([str(folder)], LOADER, of_kinds=[(kind, str(path))])
        return [[one for one in part if one.kind == kind] for part in files.load()[:2]]

    parts = load('press', presses)
    assert names_of(*parts) == [['4.npz'], ['5.npz']]
    assert not parts[0][0].slips
    # Of a single one the end is held out.
    parts = load('idle', presses / '4.npz')
    assert names_of(*parts) == [['4.npz to 8.0 s'], ['4.npz from 8.0 s']]
    assert parts[1][0].duration_s == pytest.approx(4.0, abs=0.01)
    with pytest.raises(ValueError, match=r'a\.npz: has slips, allowed: none in a recor'):
        load('idle', folder / 'a.npz')
