"""Sources: every cut of a recording gives the same rows; what is named is found."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters import files
from slip_detector.parameters.driver import DriverConfig
from slip_detector.parameters.files import shared_folder
from slip_detector.recordings import npz_recording, open_recording
from slip_detector.scenes import find_scene
from slip_detector.sources.source import RecordingSource, open_source

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
        source = RecordingSource(open_recording(path))
        pieces = [source.read(n) for n in [*cuts, N_ROWS, 1]]
    np.testing.assert_array_equal(np.concatenate([p.volts for p in pieces]), volts)
    truth = [p.truth for p in pieces if p.truth is not None]
    np.testing.assert_array_equal(np.concatenate(truth), slip)
    times = np.concatenate([p.time_s for p in pieces])
    np.testing.assert_allclose(times, np.arange(N_ROWS) / 60.0, atol=1e-9)
    assert all(len(p.volts) <= n for p, n in zip(pieces, [*cuts, N_ROWS, 1], strict=True))
    whole_cuts = [len(p.volts) == n for p, n in zip(pieces, cuts, strict=False)]
    assert all(whole_cuts) or sum(cuts) > N_ROWS
    assert len(pieces[-1].volts) == 0


def test_a_recording_without_label_plays_without_truth_and_without_platform(tmp_path):
    np.savez(tmp_path / 'a.npz', volts=np.ones((9, 2)), sample_rate_hz=60.0)
    samples = RecordingSource(open_recording(tmp_path / 'a.npz')).read(5)
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


def test_a_scene_is_one_trial_per_seed_and_another_with_each_repetition():
    def volts(seed, repetition):
        return open_source(DriverConfig(seed=seed), repetition).read(50).volts.tobytes()

    assert volts(3, 0) == volts(3, 0)
    assert volts(3, 0) != volts(3, 1)
    assert volts(3, 0) != volts(4, 0)


def test_a_scene_with_losses_says_when_the_samples_that_are_left_were_taken(tmp_path):
    path = tmp_path / 'lossy.yaml'
    path.write_text(
        'steps: [{duration_s: 2.0}]\ndrops: {share: 0.1}\nclock: {rate_ratio: 0.5}\n'
        'sample_rate_hz: 100.0\n'
    )

    def times_s(repetition):
        source = open_source(DriverConfig(scene=str(path)), repetition)
        assert source.sample_rate_hz == 100.0  # So it says; its clock runs at half of it.
        return source.read(1000).time_s

    taken_s = times_s(0)
    assert 70 < len(taken_s) < 100
    assert np.all(np.isin(taken_s, np.arange(100) / 50.0))
    assert np.all(np.diff(taken_s) > 0.0)
    assert taken_s.tobytes() == times_s(0).tobytes()
    assert taken_s.tobytes() != times_s(1).tobytes()


def test_a_scene_is_found_by_name_or_taken_by_path():
    assert find_scene('plate_400um') == shared_folder() / 'config' / 'scenes' / 'plate_400um.yaml'
    assert find_scene('plate_400um').is_file()
    assert str(find_scene('elsewhere/my.yaml')) == 'elsewhere/my.yaml'


def test_every_scene_of_the_package_opens_and_gives_samples():
    scenes = sorted((shared_folder() / 'config' / 'scenes').glob('*.yaml'))
    assert scenes
    for scene in scenes:
        source = open_source(DriverConfig(scene=scene.stem))
        assert source.read(10).volts.shape == (10, len(source.channel_names))


def test_an_unknown_scene_lists_those_there_are():
    with pytest.raises(ValueError, match=r"no scene 'plate'.*plate_400um.*path to a \.yaml"):
        find_scene('plate')


def test_a_package_without_its_folder_says_so(monkeypatch, tmp_path):
    monkeypatch.setattr(files, '__file__', str(tmp_path / 'files.py'))
    with pytest.raises(ValueError, match='without its config folder'):
        shared_folder()


def test_a_sensor_has_no_beginning_to_play_from():
    with pytest.raises(ValueError, match="source is 'udp', allowed here: scene, recording"):
        open_source(DriverConfig(source='udp'))


def test_a_recording_without_a_path_is_an_error_that_says_why():
    with pytest.raises(ValueError, match="parameter recording is '', allowed: a path, as source"):
        open_source(DriverConfig(source='recording'))
