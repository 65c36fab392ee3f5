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


"""A recording is played as if it were live, and its labels are kept beside it."""

import asyncio
import functools
import json
import shutil

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.evaluation.evaluator import RecordingLoader, evaluate_recording
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings import write_recording
from slip_detector.recordings.labels import read_labels
from slip_detector.view.access import Access
from slip_detector.view.bag import JUMP_S, STILL_S, PlayedBag
from slip_detector.view.server import Server
from support.limits import full_disk
from support.simulated_detectors import SimulatedDetectors
from support.training import samples, slipping

FINGER = '/index/slip_detector'

approx = functools.partial(pytest.approx, abs=0.02)

#: Of a plate that slides once: its rows, and when it begins and ends to slide.
ROWS = samples(slipping(), 9.6, seed=3)
SLIP_S = (ROWS.stamps_ns[np.flatnonzero(np.diff(ROWS.truth))] * 1e-9).tolist()


class Played:
    """A recording that a test plays as a server does."""

    def __init__(self, path, rows=ROWS, driver=None, read=True):
        write_recording(path, [rows], 380.0, DetectorConfig().names)
        server = self.server = Server(SimulatedDetectors(real_time=False), Access())
        driver = driver or DriverConfig()
        self.bag, self.now_s = PlayedBag(server, path, DetectorConfig(), driver, FINGER), 7.0
        if read:
            self.bag.read()

    def ask(self, kind, **content):
        return asyncio.run(self.server.answer({'type': f'bag_{kind}', **content}))

    def play(self, seconds, step_s=0.03):
        """Return stamps and volts of what is played meanwhile."""
        due = [*self.bag.due(self.now_s)]
        for _ in range(round(seconds / step_s)):
            self.now_s += step_s
            due += self.bag.due(self.now_s)
        return np.array([stamp for stamp, *_ in due]), np.array([volts for _, volts, _ in due])

    @property
    def state(self):
        self.server.tick()
        return json.loads(self.server.news['bag'])


@pytest.fixture
def unlabelled(tmp_path):
    return Played(tmp_path / 'old.mcap', ROWS._replace(truth=None, position_m=None))


@pytest.fixture(scope='module')
def shared(tmp_path_factory):
    return Played(tmp_path_factory.mktemp('shared') / 'old.npz')


@given(st.floats(0.0, 9.0), st.sampled_from([0.25, 1.0, 8.0]), st.floats(0.001, 0.9 * STILL_S))
def test_each_row_comes_once_at_its_pace_and_stamps_only_rise(shared, to_s, speed, step_s):
    before_ns, _ = shared.play(0.1)
    assert shared.ask('play', to_s=to_s, speed=speed, playing=True)['refusal'] == ''
    stamps_ns, volts = shared.play(0.6, step_s)
    first = np.searchsorted(ROWS.stamps_ns, round(to_s * 1e9))
    n = len(volts)
    np.testing.assert_array_equal(volts, ROWS.volts[first : first + n])
    np.testing.assert_allclose(np.diff(stamps_ns), np.diff(ROWS.stamps_ns[first : first + n]))
    assert (stamps_ns[:1] - before_ns[-1:] >= JUMP_S * 1e9).all()
    # The axis of the page has the place in the recording.
    shared.server.tick()
    begun_s, place_s = json.loads(shared.server.news['bag_places'])['places'][-1]
    places_s = place_s + stamps_ns * 1e-9 - begun_s
    np.testing.assert_allclose(places_s, ROWS.stamps_ns[first : first + n] * 1e-9, atol=1e-5)
    wanted = min(speed * step_s * round(0.6 / step_s) * 380.0, len(ROWS.volts) - first)
    assert n == pytest.approx(wanted, abs=2 + 380.0 * speed * step_s)


def test_it_stands_still_when_paused_unwatched_or_at_the_end_and_goes_on_with_a_gap(unlabelled):
    begun_ns, _ = unlabelled.play(1.0)
    unlabelled.ask('play', playing=False)
    assert len(unlabelled.play(3.0)[0]) == 0
    assert unlabelled.state['at_s'] == pytest.approx(1.0, abs=0.05)
    (diagnostics,) = json.loads(unlabelled.server.news['diagnostics'])['fingers'].values()
    assert diagnostics == []  # Nothing is wrong with a sensor that nobody plays.
    unlabelled.ask('play', playing=True)
    stamps_ns, volts = unlabelled.play(1.0)
    assert stamps_ns[0] - begun_ns[-1] >= JUMP_S * 1e9
    np.testing.assert_array_equal(volts[0], ROWS.volts[len(begun_ns)])
    unlabelled.now_s += 60.0  # No page was open.
    unlabelled.play(0.0)
    assert unlabelled.state['at_s'] == pytest.approx(2.0, abs=0.05)
    unlabelled.ask('play', speed=8.0)
    unlabelled.play(2.0)
    assert not unlabelled.state['playing']
    unlabelled.ask('play', playing=True)
    np.testing.assert_array_equal(unlabelled.play(0.0)[1][0], ROWS.volts[0])
    before = unlabelled.state
    for wrong in ({'to_s': -1.0}, {'to_s': float('nan')}, {'playing': 'no'}, {'speed': 'fast'}):
        asked = {'speed': 4.0, 'playing': not before['playing'], **wrong}
        assert 'allowed' in unlabelled.ask('play', **asked)['refusal']
    assert unlabelled.state == before


@pytest.mark.parametrize('name', ['old.mcap', 'old.npz', 'old.csv', 'old'])
def test_a_label_is_kept_beside_the_recording_which_stays_as_it_is(tmp_path, name):
    played = Played(tmp_path / name, ROWS._replace(truth=None, position_m=None))
    files = [path for path in tmp_path.rglob('*') if path.is_file()]
    before = [path.read_bytes() for path in files]
    file = tmp_path / 'old.labels.yaml'
    late_s = [[SLIP_S[0] + 0.2, SLIP_S[1] + 0.1]]
    assert played.ask('label', slip_s=late_s)['refusal'] == ''
    outcome = evaluate_recording(RecordingLoader(), tmp_path / name).outcome
    assert [slip.start_s for slip in outcome.slips] == [pytest.approx(late_s[0][0], abs=0.003)]
    assert played.ask('trace')['coverage'] == pytest.approx(1.0, abs=0.1)
    # A second one; then all ends by what the signal says.
    played.ask('label', slip_s=[*late_s, [9.0, 99.0]])
    assert read_labels(file).edges_s[1, 1] <= ROWS.stamps_ns[-1] * 1e-9
    played.ask('label', slip_s=late_s)
    assert played.ask('snap')['refusal'] == ''
    assert read_labels(file).accuracy_s == 0.1
    assert played.ask('trace')['slip_s'] == [pytest.approx(SLIP_S, abs=0.05)]
    for _ in range(4):
        assert file.exists()
        assert played.ask('undo_label')['refusal'] == ''
    assert not file.exists()
    assert [path.read_bytes() for path in files] == before


def test_each_end_is_as_exact_as_it_was_set_and_the_file_as_the_worst(unlabelled):
    def accuracy_after(slip_s, **content):
        assert unlabelled.ask('label', slip_s=slip_s, **content)['refusal'] == ''
        return read_labels(unlabelled.bag.file).accuracy_s

    unlabelled.ask('play', speed=2.0)
    assert accuracy_after([[1.0, 2.0]]) == 0.7
    assert accuracy_after([[1.0, 1.5]], pixel_s=0.01) == 0.7
    assert accuracy_after([[1.1, 1.5]], pixel_s=0.01) == 0.1
    assert accuracy_after([[1.1, 1.6]], pixel_s=0.25) == 0.25
    assert accuracy_after([[1.1, 1.6]], pixel_s=1e6) == 0.25
    assert accuracy_after([]) == 0.0


def test_labels_that_exist_are_shown_and_changed_in_their_file(tmp_path):
    file = tmp_path / 'elsewhere.yaml'
    file.write_text('slip_s: [[1.0, 2.5]]\naccuracy_s: 0.05\n', encoding='utf-8')
    played = Played(tmp_path / 'old.npz', driver=DriverConfig(recording_labels=str(file)))
    assert played.ask('trace')['slip_s'] == [[1.0, 2.5]]
    played.ask('label', slip_s=[[1.0, 2.5], [4.0, 5.0]], pixel_s=0.0)
    assert read_labels(file).edges_s.tolist() == [[1.0, 2.5], [4.0, 5.0]]
    played.ask('undo_label')
    assert read_labels(file).edges_s.tolist() == [[1.0, 2.5]]
    assert read_labels(file).accuracy_s == 0.05
    # Without a file, those in the recording itself.
    within = Played(tmp_path / 'within.mcap')
    assert within.ask('trace')['slip_s'] == [pytest.approx(SLIP_S, abs=0.003)]


def test_what_is_read_is_seen_and_played_and_labels_wait_for_the_rest(tmp_path):
    played = Played(tmp_path / 'old.npz', read=False)
    assert played.state['reading'] == 'opening'
    assert 'nothing of it is read' in played.ask('trace')['refusal']
    assert len(played.play(1.0)[0]) == 0
    loader, half = played.bag._loader, len(ROWS.volts) // 2

    def pieces():
        yield ROWS.take(slice(half))
        before = played.state
        assert (before['reading'], before['duration_s']) == ('reading 0 of 0 min', approx(9.6))
        trace = played.ask('trace')
        assert (trace['read_s'], trace['duration_s']) == (approx(4.8), approx(9.6))
        played.ask('play', to_s=8.0)
        assert len(played.play(1.0)[0]) == 1  # It waits for more at the end of what is read.
        assert 'is being read' in played.ask('label', slip_s=[[1.0, 2.0]])['refusal']
        yield ROWS.take(slice(half, None))

    class Halves(RecordingLoader):
        def open(self, path, require_truth=True):
            return loader.open(path, require_truth)._replace(rows=pieces())

    played.bag._loader = Halves()
    played.bag.read()
    assert played.state['reading'] == ''
    _, volts = played.play(1.0)
    np.testing.assert_array_equal(volts, ROWS.volts[half : half + len(volts)])
    assert len(volts) > 300
    assert played.ask('label', slip_s=[[1.0, 2.0]])['refusal'] == ''


def test_what_cannot_be_kept_is_said_and_changes_nothing(tmp_path, unlabelled):
    unlabelled.ask('label', slip_s=[[1.0, 2.0]])
    assert 'end of another' in unlabelled.ask('label', slip_s=[[1, 3], [2, 4]])['refusal']
    with full_disk(0):
        assert 'cannot be written' in unlabelled.ask('label', slip_s=[[3.0, 4.0]])['refusal']
    shutil.rmtree(tmp_path)
    assert 'cannot be written' in unlabelled.ask('label', slip_s=[[3.0, 4.0]])['refusal']
    assert unlabelled.ask('trace')['slip_s'] == [[1.0, 2.0]]


def test_what_does_not_suit_the_detector_is_refused(tmp_path):
    with pytest.raises(ValueError, match='has no topics /none'):
        Played(tmp_path / 'old.mcap', driver=DriverConfig(recording_topic='/none'))
    with pytest.raises(ValueError, match='its clock was set back'):
        Played(tmp_path / 'old.npz', ROWS.take(slice(99, None)).then(ROWS))
