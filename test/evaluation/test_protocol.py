"""The paper's protocol: its figures against their definitions, and the command line."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from matplotlib import image

from slip_detector.chain.samples import Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.commands.evaluate import main
from slip_detector.evaluation import protocol, protocol_trials
from slip_detector.evaluation.bounds import Bound
from slip_detector.evaluation.protocol import WANTED, claims, evaluate_protocol
from slip_detector.evaluation.protocol_trials import (
    PAPER_DELAY_MS,
    SCENES,
    Outcome,
    evaluate_plates,
    figures,
    outcome,
    plate_trial,
    read_trial,
    simulate_trials,
    with_band,
    with_windows,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.sets import read_yaml
from slip_detector.report.protocol_figures import stages
from slip_detector.report.protocol_table import MEANINGS
from slip_detector.scenes import find_scene

RATE_HZ = 100.0
KEYS = {
    'mean_delay_ms',
    'sd_delay_ms',
    'trial_delays_ms',
    'detected',
    'trials',
    'false_positive_percent',
    'channels_without_on',
}


class Deciding:
    """Stands in for a chain: says what it was told to say."""

    def __init__(self, channels, slip=None, disabled_channels=()):
        self.config = SimpleNamespace(
            sample_rate_hz=RATE_HZ,
            channels=channels.shape[1],
            disabled_channels=disabled_channels,
        )
        slip = channels.any(axis=1) if slip is None else slip
        self._result = SimpleNamespace(channels=channels, slip=slip)

    def reset(self):
        pass

    def update(self, volts, *, envelope, level):
        assert volts.shape == self._result.channels.shape
        return self._result


def moving_trial(rows=20, channels=2, start=5, end=12):
    """Make a trial whose plate moves from row ``start`` to row ``end``."""
    position_m = np.clip(np.arange(rows) - start, 0, end - start) * 1e-3
    return plate_trial(Samples(np.zeros((rows, channels)), position_m=position_m), RATE_HZ)


def on_from(rows, *firsts):
    """Make channels that go ON at a row and stay so; None: never."""
    return np.array([np.arange(rows) >= (rows if f is None else f) for f in firsts]).T


@pytest.fixture(scope='module')
def plates():
    """One simulated trial on each plate."""
    return {plate: simulate_trials(scene, [0]) for plate, scene in SCENES.items()}


# Trials.


def test_a_trial_runs_from_the_last_row_at_which_the_plate_stood_to_the_first_at_which_it_stands():
    trial = plate_trial(
        Samples(np.zeros((7, 1)), position_m=np.array([0, 0, 0, 1, 2, 2, 2.0])), RATE_HZ
    )
    assert (trial.start, trial.end) == (2, 4)
    assert trial.motion_s == (0.02, 0.04)
    assert trial.moving.tolist() == [False, False, True, True, True, False, False]
    # A pause between two motions is part of the slip, as the paper has one slip in a trial.
    positions_m = np.array([0, 1, 1, 1, 2, 2.0])
    again = plate_trial(Samples(np.zeros((6, 1)), position_m=positions_m), RATE_HZ)
    assert (again.start, again.end) == (0, 4)


def test_a_trial_without_a_platform_or_without_motion_is_refused():
    with pytest.raises(ValueError, match='the platform has no position, allowed: a source that'):
        plate_trial(Samples(np.zeros((3, 2))), RATE_HZ)
    with pytest.raises(ValueError, match='the platform does not move, allowed: a trial in which'):
        plate_trial(Samples(np.zeros((3, 2)), position_m=np.ones(3)), RATE_HZ)


@pytest.mark.parametrize('rows', [9, 10, 11, 20])
def test_a_source_is_read_to_its_end_whatever_its_length(monkeypatch, rows):
    monkeypatch.setattr(protocol_trials, 'ROWS_PER_READ', 10)

    class Counting:
        sample_rate_hz, channel_names, at = RATE_HZ, ('a',), 0

        def read(self, n):
            index = np.arange(self.at, min(self.at + n, rows), dtype=float)
            self.at += len(index)
            return Samples(index[:, np.newaxis], position_m=np.maximum(index - 3.0, 0.0))

    trial = read_trial(Counting())
    assert trial.volts.ravel().tolist() == list(range(rows))
    assert (trial.start, trial.end, trial.sample_rate_hz) == (3, rows - 1, RATE_HZ)


def test_a_seed_is_a_trial(plates):
    first, second, again = simulate_trials(SCENES['440'], [0, 1, 0])
    np.testing.assert_array_equal(first.volts, again.volts)
    np.testing.assert_array_equal(first.volts, plates['440'][0].volts)
    assert (first.volts != second.volts).any()


def test_a_scene_whose_plate_does_not_move_is_named(tmp_path):
    path = tmp_path / 'still.yaml'
    path.write_text('steps: [{duration_s: 1.0, force_n: 0.4}]')
    with pytest.raises(ValueError, match=f'^{path}: the platform does not move'):
        simulate_trials(str(path), [0])


def test_the_plates_differ_in_nothing_but_their_spatial_period():
    descriptions = {plate: read_yaml(find_scene(scene)) for plate, scene in SCENES.items()}
    for plate, description in descriptions.items():
        assert description['texture'].pop('spatial_period_m') == pytest.approx(int(plate) * 1e-6)
    assert descriptions['440'] == descriptions['400']
    assert descriptions['480'] == descriptions['400']


# Figures of merit.


def test_the_delay_of_a_channel_runs_from_the_start_to_its_first_on_while_the_plate_moves():
    channels = on_from(20, 8, 5, 12, 13, None, 0)
    channels[10:, 5] = False  # ON since before the start: there when the plate starts
    result = outcome(moving_trial(channels=6), Deciding(channels))
    assert result.delays_s == pytest.approx([0.03, 0.0, 0.07, None, None, 0.0])


def test_a_disabled_channel_has_no_part_in_the_delay():
    trial = moving_trial(channels=3)
    result = outcome(trial, Deciding(on_from(20, None, 8, 9), disabled_channels=(1,)))
    assert result.delays_s == pytest.approx([0.03, 0.04])
    assert figures([result])['channels_without_on'] == 0


@given(hnp.arrays(bool, (20, 3)), st.integers(0, 10), st.integers(1, 9))
def test_a_channel_has_a_delay_if_and_only_if_it_is_on_in_the_course_of_the_motion(
    channels, start, length
):
    trial = moving_trial(channels=3, start=start, end=start + length)
    result = outcome(trial, Deciding(channels))
    for c, delay_s in enumerate(result.delays_s):
        rows = channels[start : start + length + 1, c]
        assert (delay_s is None) == (not rows.any())
        if delay_s is not None:
            assert delay_s == pytest.approx(int(rows.argmax()) / RATE_HZ)


def of(delays_s, on=(), moving=(False, True)):
    moving = np.array(moving)
    return Outcome(tuple(delays_s), np.array(on or [False] * len(moving)), moving)


def test_the_figures_of_a_plate_by_hand():
    result = figures(
        [
            of([0.02, 0.04], on=[False, True]),
            of([0.05, None], on=[True, True]),
            of([0.03, 0.05], on=[False, False]),
        ]
    )
    assert result['trial_delays_ms'] == pytest.approx([30.0, 50.0, 40.0])
    assert result['mean_delay_ms'] == pytest.approx(40.0)
    assert result['sd_delay_ms'] == pytest.approx(10.0)  # n - 1
    assert (result['detected'], result['trials']) == (2, 3)
    assert result['false_positive_percent'] == pytest.approx(100 / 3)
    assert result['channels_without_on'] == 1
    assert set(result) == KEYS


def test_what_is_not_defined_is_none_and_never_zero():
    result = figures([of([None, None])])
    assert result['trial_delays_ms'] == [None]
    assert (result['mean_delay_ms'], result['sd_delay_ms']) == (None, None)
    assert (result['detected'], result['channels_without_on']) == (0, 2)
    one = figures([of([0.03]), of([None])])
    assert one['trial_delays_ms'] == [pytest.approx(30.0), None]
    assert (one['mean_delay_ms'], one['sd_delay_ms']) == (pytest.approx(30.0), None)
    assert figures([of([0.0], moving=[True, True])])['false_positive_percent'] is None


def test_false_positives_are_pooled_over_the_time_of_all_trials():
    long = of([0.0], on=[False] * 8 + [True] * 2, moving=[False] * 9 + [True])
    short = of([0.0], on=[True, True], moving=[False, True])
    assert figures([long, short])['false_positive_percent'] == pytest.approx(20.0)


def test_an_on_outside_the_motion_is_no_detection():
    trial = moving_trial(channels=1, start=5, end=12)
    slip = np.zeros(20, bool)
    slip[[2, 4, 13, 19]] = True
    result = figures([outcome(trial, Deciding(slip[:, np.newaxis], slip))])
    assert result['detected'] == 0
    assert result['false_positive_percent'] == pytest.approx(100 * 4 / 12)


def test_a_trial_that_does_not_suit_the_chain_is_refused_with_its_plate():
    trial = moving_trial(channels=4)
    config = {'passband_hz': (7.0, 40.0), 'stopbands_hz': (), 'sample_rate_hz': RATE_HZ}
    with pytest.raises(
        ValueError, match=r'^plate 400: the trial has 4 channels, allowed: 16, the parameter chann'
    ):
        evaluate_plates({'400': [trial]}, ChainConfig(**config))
    with pytest.raises(
        ValueError, match=r'^plate 400: the trial has 100 Hz where the parameter sample_rate_hz is'
    ):
        evaluate_plates({'400': [trial]}, ChainConfig(channels=4))


def test_each_trial_starts_with_a_chain_that_remembers_nothing(plates):
    (trial,) = plates['400']
    twice = evaluate_plates({'400': [trial, trial]}, ChainConfig())['plates']['400']
    once = evaluate_plates({'400': [trial]}, ChainConfig())['plates']['400']
    assert twice['trial_delays_ms'] == once['trial_delays_ms'] * 2
    assert twice['false_positive_percent'] == pytest.approx(once['false_positive_percent'])


# The variants of the chain.


def test_another_window_is_that_of_both_stages_and_nothing_else():
    config = ChainConfig(threshold=0.7)
    other = with_windows(config, 0.03)
    assert (other.envelope_window_s, other.decision_window_s) == (0.03, 0.03)
    assert with_windows(other, 0.04) == config


@pytest.mark.parametrize(
    ('passband_hz', 'stopbands_hz', 'kept'),
    [
        ((7.0, 50.0), ((0.5, 7.0), (50.0, 180.0)), ((0.5, 7.0),)),
        ((7.0, 50.0), ((45.0, 55.0), (60.0, 180.0)), ((45.0, 55.0),)),
        ((7.0, 0.0), ((0.5, 7.0), (45.0, 55.0)), ((0.5, 7.0), (45.0, 55.0))),
    ],
)
def test_another_band_goes_without_the_stop_bands_above_the_configured_one(
    passband_hz, stopbands_hz, kept
):
    config = ChainConfig(passband_hz=passband_hz, stopbands_hz=stopbands_hz, vote=2)
    other = with_band(config, (10.0, 150.0))
    assert (other.passband_hz, other.stopbands_hz, other.vote) == ((10.0, 150.0), kept, 2)


def test_each_variant_has_the_figures_of_the_same_trials_through_its_chain(plates):
    config = ChainConfig()
    result = evaluate_protocol(plates, config)
    assert list(result['windows']) == ['20', '30', '40']
    assert list(result['bands']) == ['10-100', '10-150']
    # The paper's own windows are the default.
    assert result['windows']['40'] == {key: result[key] for key in ('plates', 'all')}
    short = ChainConfig(envelope_window_s=0.02, decision_window_s=0.02)
    wide = ChainConfig(passband_hz=(10.0, 150.0), stopbands_hz=((0.5, 7.0),))
    assert result['windows']['20'] == evaluate_plates(plates, short)
    assert result['bands']['10-150'] == evaluate_plates(plates, wide)
    assert result['all']['trials'] == 3


@pytest.mark.parametrize(
    'changes', [{}, {'exponent': 2, 'rectify': 'half', 'common_mode': 'median'}]
)
def test_the_stages_that_are_drawn_are_those_of_the_chain(plates, changes):
    config = ChainConfig(**changes)
    (trial,) = plates['400']
    raw, _, power, envelope, level = stages(trial, config, 5).values()
    result = SlipChain(config).update(trial.volts)
    np.testing.assert_array_equal(raw, trial.volts[:, 4])
    np.testing.assert_array_equal(level, result.level[:, 4])
    window = np.full(15, 1 / 15)  # 40 ms
    rms = np.sqrt(np.convolve(power**2, window)[: len(power)])
    np.testing.assert_allclose(rms, envelope, rtol=1e-6, atol=1e-9 * envelope.max())


# What is wanted.


@pytest.mark.parametrize(
    ('bound', 'text', 'met', 'missed'),
    [
        (Bound(low=1.0), '>= 1', [1.0, 5.0], [0.9]),
        (Bound(high=1.01), '<= 1.01', [1.01, -1.0], [1.02]),
        (Bound(low=0.0, strict=True), '> 0', [1e-9], [0.0, -1.0]),
        (Bound(1.0, 2.0), '1.00 to 2.00', [1.0, 2.0], [0.9, 2.1]),
    ],
)
def test_a_bound_is_met_or_missed_and_missed_by_what_is_not_defined(bound, text, met, missed):
    assert str(bound) == text
    assert all(bound.met(value) for value in met)
    assert not any(bound.met(value) for value in [*missed, None])


def part(delays_ms, false_percent, detected=10):
    """Make figures of three plates by their means, and of all by their false positives."""
    return {
        'plates': {
            plate: {'mean_delay_ms': delay, 'false_positive_percent': percent}
            for plate, delay, percent in zip(SCENES, delays_ms, (0.5, 1.5, 1.0), strict=True)
        },
        'all': {'detected': detected, 'trials': 10, 'false_positive_percent': false_percent},
    }


def hand_made(**changes):
    result = {
        **part([36.0, 42.0, 49.0], 1.0, detected=9),
        'windows': {
            '20': part([1.0, 1.0, 1.0], 3.0),
            '30': part([1.0, 1.0, 1.0], 1.5),
            '40': part([1.0, 1.0, 1.0], 1.0),
        },
        'bands': {
            '10-100': part([30.0, 40.0, 40.0], 1.0),
            '10-150': part([29.0, 43.0, 39.0], 1.0),
        },
    }
    return {**result, **changes}


def test_the_claims_by_hand():
    assert claims(hand_made()) == pytest.approx(
        {
            'detected_percent': 90.0,
            'mean_delay_ms.400': 36.0,
            'mean_delay_ms.440': 42.0,
            'mean_delay_ms.480': 49.0,
            'least_rise_ms': 6.0,
            'worst_false_positive_percent': 1.5,
            'windows.20.false_positive_percent_more': 2.0,
            'windows.30.false_positive_percent_more': 0.5,
            'windows.40.false_positive_percent_more': 0.0,
            'bands.10-100.least_shortening_ms': 2.0,
            'bands.10-150.least_shortening_ms': -1.0,
        }
    )
    undefined = claims(hand_made(plates=part([36.0, None, 49.0], 1.0)['plates']))
    assert undefined['least_rise_ms'] is None
    assert undefined['mean_delay_ms.440'] is None
    assert undefined['bands.10-100.least_shortening_ms'] is None


def test_what_is_wanted_is_what_the_paper_reports():
    assert set(WANTED) == set(MEANINGS) <= set(claims(hand_made()))
    assert PAPER_DELAY_MS == {'400': (36.02, 3.91), '440': (41.78, 10.78), '480': (48.90, 9.91)}
    for plate, (mean, sd) in PAPER_DELAY_MS.items():
        assert WANTED[f'mean_delay_ms.{plate}'] == (mean - sd, mean + sd, False)
    assert WANTED['worst_false_positive_percent'].high == 1.01
    assert WANTED['detected_percent'].low == 100.0


# Command line.


def run(capsys, *arguments):
    assert main(['--protocol', 'paper', *map(str, arguments)]) == 0
    captured = capsys.readouterr()
    assert captured.err == ''
    return captured.out


def complaint(capsys, *arguments, code):
    """Run what must fail; returns the one line that it says."""
    try:
        status = main([*map(str, arguments)])
    except SystemExit as leave:
        status = leave.code
    captured = capsys.readouterr()
    assert (status, captured.out, captured.err.count('\n')) == (code, '', 1)
    return captured.err.removeprefix('slip_evaluate: ').rstrip('\n')


def test_json_has_the_documented_figures(capsys, plates):
    result = json.loads(run(capsys, '--json', '--trials', 2, '--seed', 7))
    assert list(result) == [
        'seeds', 'scenes', 'paper', 'plates', 'all', 'windows', 'bands', 'wanted', 'plots',
    ]  # fmt: skip
    assert all(f'``{key}``' in protocol.__doc__ for key in [*result, *KEYS])
    assert (result['seeds'], result['plots']) == ([7, 8], [])
    assert list(result['plates']) == ['400', '440', '480']
    for figures_ in [*result['plates'].values(), result['all']]:
        assert set(figures_) == KEYS
    assert [len(part['trial_delays_ms']) for part in result['plates'].values()] == [2, 2, 2]
    for variants in (result['windows'], result['bands']):
        assert all(list(part) == ['plates', 'all'] for part in variants.values())
    assert set(result['wanted']) == set(WANTED)
    assert all(set(entry) == {'value', 'bound', 'met'} for entry in result['wanted'].values())
    assert result['paper']['plates']['480'] == {'mean_delay_ms': 48.9, 'sd_delay_ms': 9.91}
    assert result['paper']['false_positive_percent'] == 1.01
    # The same as from Python.
    trials = {'440': simulate_trials(SCENES['440'], [7, 8])}
    assert result['plates']['440'] == evaluate_plates(trials, ChainConfig())['plates']['440']


def test_the_table_has_the_paper_beside_ours_and_what_is_wanted(capsys):
    lines = run(capsys, '--trials', 1).splitlines()

    def words(head):
        (line,) = [line for line in lines if line.strip().startswith(head)]
        return line.strip().removeprefix(head).split()

    assert words('mean, paper') == ['36.02', '41.78', '48.90']
    assert words('sd, paper') == ['3.91', '10.78', '9.91']
    assert words('false positives, paper [%]') == ['1.01']
    assert len(words('seed 0')) == 3
    assert words('sd  ')[:3] == ['-', '-', '-']  # of one trial
    for meaning in MEANINGS.values():
        assert words(meaning)[-1] == 'met'
    assert max(map(len, lines)) < 130


def test_the_configuration_is_that_of_the_file(capsys, tmp_path):
    path = tmp_path / 'deaf.yaml'
    path.write_text('/**/slip_detector: {ros__parameters: {threshold: 1.0e+30}}')
    result = json.loads(run(capsys, '--json', '--trials', 1, '--config', path))
    assert result['plates']['400']['trial_delays_ms'] == [None]
    assert result['plates']['400']['mean_delay_ms'] is None
    assert result['plates']['400']['channels_without_on'] == 16
    assert result['all']['detected'] == 0
    assert result['wanted']['mean_delay_ms.400'] == {
        'value': None, 'bound': '32.11 to 39.93', 'met': False,
    }  # fmt: skip
    text = run(capsys, '--trials', 1, '--config', path, '--plot', tmp_path / 'deaf')
    assert 'nan' not in text.lower()


def test_the_pictures_are_written_and_show_something(capsys, tmp_path):
    folder = tmp_path / 'new' / 'out'
    result = json.loads(run(capsys, '--json', '--trials', 2, '--plot', folder))
    names = [f'paper_fig{number}.png' for number in (2, 4, 5, 6, 7)]
    assert result['plots'] == [str(folder / name) for name in names]
    assert sorted(path.name for path in folder.iterdir()) == names
    for name in names:
        picture = image.imread(folder / name)[..., :3]
        assert min(picture.shape[:2]) > 300
        colours = np.unique((picture.reshape(-1, 3) * 255).astype(int), axis=0)
        assert len(colours) > 20
        # Something in the outermost tenths, too: labels and axes are not cut away.
        assert all((part < 0.5).any() for part in np.array_split(picture, 10, axis=0)[::9])


@pytest.mark.parametrize(
    ('arguments', 'code', 'said'),
    [
        (['--protocol', 'paper', 'a.npz'], 2, '--protocol simulates its trials, allowed: no REC'),
        (['--trials', '3', 'a.npz'], 2, '--trials is for simulated trials, allowed: with --prot'),
        (['--seed', '3', 'a.npz'], 2, '--seed is for simulated trials, allowed: with --protocol'),
        (
            ['--protocol', 'paper', '--report', 'a.html'],
            2,
            '--report is for recordings, allowed: without --protocol',
        ),
        (
            ['--protocol', 'paper', '--topic', 'a'],
            2,
            '--topic is for recordings, allowed: without --protocol',
        ),
        (['--protocol', 'mine'], 2, "argument --protocol: invalid choice: 'mine' (choose from "),
        (
            ['--protocol', 'paper', '--trials', '0'],
            2,
            "argument --trials: is '0', allowed: a whole number, 1 to 1000",
        ),
        (
            ['--protocol', 'paper', '--seed', '-1'],
            2,
            "argument --seed: is '-1', allowed: a whole number, 0 to 2147483647",
        ),
        (['--protocol', 'paper', '--config', 'no.yaml'], 1, 'no.yaml: cannot be read (No such fi'),
    ],
)
def test_wrong_arguments_are_said_in_one_line(capsys, arguments, code, said):
    assert complaint(capsys, *arguments, code=code).startswith(said)


def test_a_folder_that_cannot_be_made_or_written_to_is_named(capsys, tmp_path):
    (tmp_path / 'file').touch()
    arguments = ['--protocol', 'paper', '--trials', '1', '--plot']
    line = complaint(capsys, *arguments, tmp_path / 'file', code=1)
    assert line == f'{tmp_path / "file"}: cannot be made (File exists)'
    (tmp_path / 'full' / 'paper_fig4.png').mkdir(parents=True)
    line = complaint(capsys, *arguments, tmp_path / 'full', code=1)
    assert line == f'{tmp_path / "full"}: cannot be written to (Is a directory)'


def test_the_papers_results_are_reproduced():
    trials = {
        plate: simulate_trials(scene, range(protocol.TRIALS)) for plate, scene in SCENES.items()
    }
    result = evaluate_protocol(trials, ChainConfig())
    assert (result['all']['detected'], result['all']['trials']) == (30, 30)
    missed = {name: entry for name, entry in result['wanted'].items() if not entry['met']}
    assert not missed
