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

"""Labels: what a person writes by hand is taken as it was meant, or refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.recordings import open_recording
from slip_detector.recordings.labels import BY_EYE_S, find_labels, snap_ends
from slip_detector.recordings.writing import BagWriter
from support.config_cases import message_of

RATE_HZ = 100.0
N_ROWS = 1000


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / 'trial.npz'
    np.savez(path, volts=np.ones((N_ROWS, 2)), sample_rate_hz=RATE_HZ, slip=np.zeros(N_ROWS))
    return path


def truth(path, labels=''):
    config = RecordingConfig(recording_labels=str(labels))
    return np.concatenate([piece.truth for piece in open_recording(path, config).pieces()])


@given(edges=st.lists(st.integers(0, N_ROWS), max_size=12, unique=True), data=st.data())
def test_a_row_has_slip_from_a_start_up_to_its_end(tmp_path_factory, edges, data):
    edges = sorted(edges)[: len(edges) // 2 * 2]
    pairs = list(zip(edges[::2], edges[1::2], strict=True))
    lines = [f'  - [{start / RATE_HZ!r}, {end / RATE_HZ!r}]  # seen' for start, end in pairs]
    shuffled = data.draw(st.permutations(lines))
    folder = tmp_path_factory.mktemp('labels')
    np.savez(folder / 'a.npz', volts=np.ones((N_ROWS, 1)), sample_rate_hz=RATE_HZ)
    path = folder / 'a.labels.yaml'
    path.write_text('\n'.join(['# by hand', 'slip_s:' if pairs else 'slip_s: []', *shuffled]))
    k = np.arange(N_ROWS)
    wanted = np.zeros(N_ROWS, bool)
    for start, end in pairs:
        wanted |= (k >= start) & (k < end)
    np.testing.assert_array_equal(truth(folder / 'a.npz'), wanted)


def test_a_file_beside_it_or_in_a_folder_goes_before_what_a_recording_says(tmp_path, recording):
    assert not truth(recording).any()
    (tmp_path / 'trial.labels.yaml').write_text('slip_s: [[1, 2]]')
    assert truth(recording).sum() == 100
    folder = tmp_path / 'by_hand'
    folder.mkdir()
    (folder / 'trial.labels.yaml').write_text('slip_s: [[1, 3]]')
    assert truth(recording, folder).sum() == 200
    assert open_recording(recording).has_truth
    assert find_labels('', tmp_path / 'other.mcap') is None
    # A dot in the name of a folder is no ending.
    bag, labels = tmp_path / 'push_0.5N', tmp_path / 'push_0.5N.labels.yaml'
    bag.mkdir()
    labels.touch()
    assert find_labels('', bag) == find_labels(str(tmp_path), bag) == labels
    with pytest.raises(ValueError, match=r'other\.labels\.yaml: cannot be read \(No such file'):
        open_recording(tmp_path / 'other.mcap', RecordingConfig(recording_labels=str(folder)))


def test_a_recording_of_a_kind_needs_no_other_label_and_says_so(tmp_path):
    np.savez(tmp_path / 'trial.npz', volts=np.ones((N_ROWS, 2)), sample_rate_hz=RATE_HZ)
    (tmp_path / 'trial.labels.yaml').write_text('kind: press')
    (tmp_path / 'bag').mkdir()
    bag = BagWriter(tmp_path / 'bag' / 'trial', ['a', 'b'], kind='idle')
    bag.write(Samples.evenly(np.ones((N_ROWS, 2)), RATE_HZ, np.zeros(N_ROWS)))
    bag.close()
    for path, kind in ((tmp_path / 'trial.npz', 'press'), (bag.path.parent, 'idle')):
        pieces = list(open_recording(path).pieces())
        assert {piece.kind for piece in pieces} == {kind}
        assert not any(piece.truth.any() for piece in pieces)
    # What a person writes goes before what the bag says.
    (tmp_path / 'bag' / 'trial.labels.yaml').write_text('slip_s: [[1, 2]]')
    assert {piece.kind for piece in open_recording(bag.path.parent).pieces()} == {''}


OUTSIDE = 'is outside the recording trial.npz, allowed: 0 to 10 s'
PAIRS = ', allowed: slip_s: [[start, end], ...] in seconds, or kind'


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('slip_s:\n- [1, 2]\n- [9, 10.02]', f': the slip [9, 10.02] s {OUTSIDE}'),
        ('slip_s:\n- [-1, 3]', ': the slip [-1, 3] s is not allowed: it begins before 0 s or'),
        ('slip_s:\n- [5, 6]\n- [1, 5.5]', ': the slip [5, 6] s is not allowed'),
        ('slip_s:\n- [1, 2]\n- [3, 3]', ': the slip [3, 3] s is not allowed'),
        ('slip_s:\n- [1, .nan]', ': the slip [1, nan] s is not allowed'),
        ('slips:\n- [1, 2]', ': has the key slips, allowed: slip_s, accuracy_s, kind, mistaken'),
        ('mistaken: 1', ': mistaken is 1, allowed: true, false'),
        ('kind: [press]', ": kind is ['press'], allowed: rest, taps, press, roll"),
        ('kind: press\nslip_s: [[1, 2]]', ': has slips, allowed: none in a recording of the kind'),
        ('slip_s:\n- [1, two]', f": slip_s is [[1, 'two']]{PAIRS}"),
        ('slip_s:\n- [1, [2]]', f': slip_s is [[1, [2]]]{PAIRS}'),
        ('{}', f': has no slip_s{PAIRS}'),
        ('- [1, 2]', ': is not a YAML file of names and values'),
    ],
)
def test_what_is_wrong_is_named(tmp_path, recording, text, said):
    path = tmp_path / 'mine.yaml'
    path.write_text(text)
    assert message_of(truth, recording, path).startswith(f'{path}{said}')


def noise(rows, channels, seed):
    """Return noise with hum, as of a sensor at rest."""
    volts = np.random.default_rng(seed).normal(size=(rows, channels))
    return volts + np.sin(2.0 * np.pi * 50.0 * np.arange(rows) / 380.0)[:, np.newaxis]


@given(
    slips=st.lists(st.integers(300, 900), min_size=1, max_size=3),
    late_s=st.floats(-0.35, 0.6),
    rises_db=st.sampled_from([6.0, 12.0, 30.0]),
    channels=st.sampled_from([1, 8]),
    seed=st.integers(0, 99),
)
def test_an_end_that_is_found_is_exact_and_all_that_are_loud_are_found(
    slips, late_s, rises_db, channels, seed
):
    edges = np.cumsum([800, *np.repeat(slips, 2)])[:-1].reshape(-1, 2)
    volts = noise(edges[-1, 1] + 800, channels, seed)
    for begin, end in edges:
        volts[begin:end] *= 10.0 ** (rises_db / 20.0)
    samples = Samples.evenly(4.3 + 1e-3 * volts, 380.0, np.zeros(len(volts)))
    by_hand_s = edges / 380.0 + late_s
    near_s, found, _ = snap_ends(samples, by_hand_s, 380.0, 0.35)
    off_s = np.abs(near_s - edges / 380.0)
    assert off_s[found].max(initial=0.0) <= BY_EYE_S
    np.testing.assert_array_equal(near_s[~found], by_hand_s[~found])
    if rises_db >= 12.0 and channels > 1:
        assert found.all()


@given(
    edges=st.lists(st.integers(0, 2000), min_size=2, max_size=6, unique=True),
    channels=st.sampled_from([1, 4]),
    seed=st.integers(0, 99),
)
def test_where_no_power_changes_no_end_is_found(edges, channels, seed):
    volts = noise(2000, channels, seed)
    samples = Samples.evenly(volts, 380.0, np.zeros(2000))
    edges_s = np.reshape(sorted(edges)[: len(edges) // 2 * 2], (-1, 2)) / 380.0
    near_s, found, _ = snap_ends(samples, edges_s, 380.0, 0.35)
    assert not found.any()
    np.testing.assert_array_equal(near_s, edges_s)
    assert not snap_ends(samples.take(slice(6)), edges_s, 380.0, 1.0)[1].any()


def test_a_change_beyond_the_reach_or_of_the_wrong_sign_is_not_taken_for_an_end():
    volts = noise(3000, 4, 1)
    volts[1500:] *= 5.0
    samples = Samples.evenly(volts, 380.0, np.zeros(3000))
    # The power rises 0.9 s before one end and near the other, which should fall.
    edges_s = np.array([[1500 / 380.0 + 0.9, 7.0], [7.2, 7.8]])
    for its_s in (edges_s[:1], edges_s, np.array([[2.0, 1500 / 380.0 + 0.1]])):
        assert not snap_ends(samples, its_s, 380.0, 0.35)[1].any()
