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
from slip_detector.recordings.labels import find_labels, snapped
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


@given(
    edges=st.lists(st.integers(0, N_ROWS), min_size=0, max_size=12, unique=True), data=st.data()
)
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


def test_a_file_beside_the_recording_or_in_a_folder_goes_before_what_the_recording_says(
    tmp_path, recording
):
    assert not truth(recording).any()
    (tmp_path / 'trial.labels.yaml').write_text('slip_s: [[1, 2]]')
    assert truth(recording).sum() == 100
    folder = tmp_path / 'by_hand'
    folder.mkdir()
    (folder / 'trial.labels.yaml').write_text('slip_s: [[1, 3]]')
    assert truth(recording, folder).sum() == 200
    assert open_recording(recording).has_truth
    assert find_labels('', tmp_path / 'other.mcap') is None
    assert find_labels(str(folder), tmp_path / 'trial') == folder / 'trial.labels.yaml'
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
WRONG = ': has more or less than slip_s: [[start, end]] and accuracy_s, all in seconds'


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('slip_s:\n- [1, 2]\n- [9, 10.02]', f': the slip [9, 10.02] s {OUTSIDE}'),
        ('slip_s:\n- [-1, 3]', ': the slip [-1, 3] s is not allowed: it begins before 0 s or'),
        ('slip_s:\n- [5, 6]\n- [1, 5.5]', ': the slip [5, 6] s is not allowed'),
        ('slip_s:\n- [1, 2]\n- [3, 3]', ': the slip [3, 3] s is not allowed'),
        ('slip_s:\n- [1, .nan]', ': the slip [1, nan] s is not allowed'),
        ('slips:\n- [1, 2]', WRONG),
        ('slip_s: []\nunit: ms', WRONG),
        ('slip_s: 3', WRONG),
        ('kind: pressed', ": kind is 'pressed', allowed: rest, taps, press, roll, idle"),
        ('kind: [press]\nslip_s: []', ": kind is ['press'], allowed: rest, taps"),
        ('kind: press\nslip_s: [[1, 2]]', ': has slips, allowed: none in a recording of the kind'),
        ('slip_s:\n- [1, two]', WRONG),
        ('slip_s:\n- {start: 1, end: 2}', WRONG),
        ('slip_s:\n- [1, [2]]', WRONG),
        ('{}', WRONG),
        ('slip_s:\n- [1, 1:40]', ': line 2: 1:40 is not what it looks like'),
        ('- [1, 2]', ': is not a YAML file of names and values'),
    ],
)
def test_what_is_wrong_is_named(tmp_path, recording, text, said):
    path = tmp_path / 'mine.yaml'
    path.write_text(text)
    assert message_of(truth, recording, path).startswith(f'{path}{said}')


def test_a_dot_in_the_name_of_a_folder_is_no_ending(tmp_path):
    recording, labels = tmp_path / 'push_0.5N', tmp_path / 'push_0.5N.labels.yaml'
    recording.mkdir()
    labels.write_text('slip_s: []')
    assert find_labels('', recording) == find_labels(str(tmp_path), recording) == labels


@given(
    slips=st.lists(st.integers(150, 300), min_size=1, max_size=3),
    late=st.integers(-30, 30),
    power=st.sampled_from([4.0, 30.0]),
    seed=st.integers(0, 99),
)
def test_snapped_ends_are_where_the_power_changes_on_any_level(slips, late, power, seed):
    edges = np.cumsum([200, *np.repeat(slips, 2)])[:-1].reshape(-1, 2)
    volts = np.random.default_rng(seed).normal(size=(edges[-1, 1] + 300, 8)) * 1e-3 + 4.3
    for begin, end in edges:
        volts[begin:end] = 4.3 + power * (volts[begin:end] - 4.3)
    samples = Samples.evenly(volts, RATE_HZ, np.zeros(len(volts)))
    near = snapped(samples, (edges + late) / RATE_HZ, RATE_HZ, 0.35)
    np.testing.assert_allclose(near, edges / RATE_HZ, atol=3 / RATE_HZ)


@given(seed=st.integers(0, 99))
def test_an_end_without_a_change_of_power_as_it_should_be_stays(seed):
    volts = 4.3 + 1e-3 * np.random.default_rng(seed).normal(size=(N_ROWS, 4))
    volts[500:] = 4.3 + 5.0 * (volts[500:] - 4.3)
    samples = Samples.evenly(volts, RATE_HZ, np.zeros(N_ROWS))
    # The power rises near the end of the slip, and does not change near its start.
    edges_s = np.array([[2.0, 5.1]])
    np.testing.assert_array_equal(snapped(samples, edges_s, RATE_HZ, 0.35), edges_s)
    np.testing.assert_array_equal(snapped(samples.take(slice(6)), edges_s, RATE_HZ, 1.0), edges_s)
