"""Disturbances: each does what its parameters say, and nothing else."""

import itertools
import re
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.parameters.detector import PAPER_CHANNELS
from slip_detector.scenes.disturbances import (
    Clock,
    Drops,
    Faults,
    FaultyChannels,
    HandMotion,
    Hum,
    HumVoltage,
    LossyLink,
    Rolling,
    Taps,
    Tremor,
    lines_at,
    lines_rate_at,
    rolled_at,
    tap_force_at,
)
from slip_detector.scenes.electronics import Electronics, Frontend

CUTS = st.lists(st.integers(0, 60), max_size=12).map(lambda cuts: np.cumsum(cuts, dtype=int))

RATE_HZ = 380.0


class Refusing(np.random.Generator):
    """A generator that draws nothing, and whose children do not either."""

    def __init__(self):
        super().__init__(np.random.PCG64(0))

    def _refuse(self, *args, **keywords):
        raise AssertionError('something was drawn')

    standard_normal = uniform = random = _refuse

    def spawn(self, n_children):
        return [Refusing() for _ in range(n_children)]


def trial(seed=0):
    return np.random.default_rng(seed)


def times_s(duration_s, rate_hz=RATE_HZ):
    return np.arange(round(duration_s * rate_hz)) / rate_hz


def tapped_n(taps, time_s):
    return tap_force_at(time_s, time_s, taps.numbers())


def rolled_m(rolling, time_s):
    """Return how far the centre of contact has moved, shape (n, 2)."""
    return np.transpose(rolled_at(time_s, rolling.numbers()))


def closed_forms(seed):
    hum = HumVoltage(Hum(harmonics=[0.3, 0.0, 0.1]), trial(seed))
    hand = HandMotion(Tremor(), trial(seed))
    return {
        'hum': hum.volts,
        'tremor force': lambda t: lines_at(t, hand.force_lines),
        'tremor position': lambda t: lines_at(t, hand.motion_lines),
        'tremor velocity': lambda t: lines_rate_at(t, hand.motion_lines),
        'taps': partial(tapped_n, Taps(times_s=[0.1, 0.3, 0.52])),
        'rolling': partial(rolled_m, Rolling(start_s=0.1, duration_s=0.1, hold_s=0.03, repeats=2)),
    }


@given(CUTS, st.integers(0, 99), st.floats(0, 4000))
def test_any_cut_of_the_times_gives_the_same_bits(cuts, seed, start_s):
    t = start_s + times_s(0.6)
    for name, form in closed_forms(seed).items():
        pieces = [form(piece) for piece in np.split(t, cuts)]
        assert np.concatenate(pieces).tobytes() == form(t).tobytes(), name


def test_one_instant_alone_is_allowed():
    t = times_s(0.6)
    for name, form in closed_forms(0).items():
        for i in (0, 40, 130):
            np.testing.assert_array_equal(form(t[i]), form(t)[i], err_msg=name)


def test_an_hour_later_the_disturbances_are_as_exact_as_at_the_start():
    # Against the same lines with the whole turns taken out in integers first.
    t_ms = 3_600_000 + np.arange(1000)
    hum = HumVoltage(Hum(amplitude_v=1.0), trial())
    turns_ms = t_ms % 20
    expected = np.sin(2 * np.pi * turns_ms / 20 + hum.lines.phase_rad[0])
    np.testing.assert_allclose(hum.volts(t_ms / 1000), expected, atol=1e-8)


# Hum.


def spectrum(values, rate_hz):
    """Return frequencies and amplitudes of a signal of whole seconds."""
    return np.fft.rfftfreq(len(values), 1 / rate_hz), 2 * np.abs(np.fft.rfft(values)) / len(values)


@given(
    st.integers(16, 60),
    st.floats(1e-4, 1),
    st.lists(st.floats(0, 1), max_size=3),
    st.integers(0, 99),
)
def test_hum_is_at_its_frequency_and_harmonics_with_their_amplitudes(
    frequency_hz, amplitude_v, harmonics, seed
):
    hum = Hum(frequency_hz=frequency_hz, amplitude_v=amplitude_v, harmonics=harmonics)
    volts = HumVoltage(hum, trial(seed)).volts(times_s(1.0, 1000.0))
    assert volts.shape == (1000,)  # One for all channels.
    expected = np.zeros(501)
    expected[frequency_hz] = amplitude_v
    for number, relative in enumerate(harmonics, start=2):
        expected[number * frequency_hz] = relative * amplitude_v
    np.testing.assert_allclose(spectrum(volts, 1000.0)[1], expected, atol=1e-9)


def test_hum_has_another_phase_in_another_trial():
    t = times_s(0.5)
    one, same, other = (HumVoltage(Hum(), trial(seed)).volts(t) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 1e-3


def test_a_harmonic_more_leaves_the_fundamental_as_it_is():
    t = times_s(1.0, 1000.0)
    plain = HumVoltage(Hum(), trial()).volts(t)
    more = HumVoltage(Hum(harmonics=[0.5]), trial()).volts(t)
    difference = spectrum(more - plain, 1000.0)[1]
    assert difference[100] == pytest.approx(0.5 * 5e-3)
    assert np.delete(difference, 100).max() < 1e-12


# Tremor.


@given(st.floats(0.1, 30), st.floats(1.001, 30), st.integers(0, 999))
def test_tremor_lies_in_its_band_with_the_rms_asked_for(low_hz, ratio, seed):
    tremor = Tremor(low_hz=low_hz, high_hz=low_hz * ratio, force_rms_n=0.3, motion_rms_m=2e-5)
    hand = HandMotion(tremor, trial(seed))
    for lines, rms in ((hand.force_lines, 0.3), (hand.motion_lines, 2e-5)):
        frequency_hz = lines.angular_rate_rad_s / (2 * np.pi)
        assert np.all((frequency_hz > tremor.low_hz) & (frequency_hz < tremor.high_hz))
        assert len(set(frequency_hz)) == len(frequency_hz)
        # Lines of different frequencies add their powers.
        assert np.sqrt(np.sum(lines.amplitude**2) / 2) == pytest.approx(rms, rel=1e-12)


@pytest.mark.parametrize('seed', range(3))
def test_in_the_long_run_tremor_has_the_rms_and_the_band_asked_for(seed):
    hand = HandMotion(Tremor(force_rms_n=0.3, motion_rms_m=2e-5), trial(seed))
    t = times_s(2000.0, 100.0)
    for values, rms in (
        (lines_at(t, hand.force_lines), 0.3),
        (lines_at(t, hand.motion_lines), 2e-5),
    ):
        assert np.sqrt(np.mean(values**2)) == pytest.approx(rms, rel=0.01)
        hz, amplitude = spectrum(values * np.hanning(len(t)), 100.0)
        outside = (hz < 1.9) | (hz > 20.1)
        assert np.sum(amplitude[outside] ** 2) < 1e-4 * np.sum(amplitude**2)


def test_tremor_beats_slowly():
    hand = HandMotion(Tremor(force_rms_n=0.3), trial())
    t = times_s(200.0, 100.0)
    # RMS over 2 s, the longest period of the band four times.
    over_2s = np.sqrt(np.mean(lines_at(t, hand.force_lines).reshape(-1, 200) ** 2, axis=1))
    assert over_2s.max() > 1.3 * over_2s.min()


@given(st.integers(0, 999), st.floats(0, 100))
def test_the_velocity_of_tremor_is_the_derivative_of_its_position(seed, start_s):
    hand = HandMotion(Tremor(motion_rms_m=1e-3), trial(seed))
    h, t = 1e-4, start_s + times_s(0.5)
    x = [lines_at(t + k * h, hand.motion_lines) for k in (-2, -1, 1, 2)]
    slope_m_s = (x[0] - 8 * x[1] + 8 * x[2] - x[3]) / (12 * h)
    np.testing.assert_allclose(lines_rate_at(t, hand.motion_lines), slope_m_s, atol=1e-9)


def test_force_and_motion_of_tremor_are_independent_of_each_other():
    t = times_s(0.5)
    both = HandMotion(Tremor(), trial())
    force = HandMotion(Tremor(motion_rms_m=0.0), trial())
    motion = HandMotion(Tremor(force_rms_n=0.0), trial())
    np.testing.assert_array_equal(lines_at(t, force.force_lines), lines_at(t, both.force_lines))
    np.testing.assert_array_equal(lines_at(t, motion.motion_lines), lines_at(t, both.motion_lines))
    assert not lines_at(t, force.motion_lines).any()
    assert not lines_rate_at(t, force.motion_lines).any()
    assert not lines_at(t, motion.force_lines).any()
    assert not set(both.force_lines.phase_rad) & set(both.motion_lines.phase_rad)


def test_nothing_is_drawn_for_a_tremor_that_is_zero():
    HandMotion(Tremor(force_rms_n=0.0, motion_rms_m=0.0), Refusing())
    for part in ({'force_rms_n': 0.0}, {'motion_rms_m': 0.0}):
        with pytest.raises(AssertionError, match='something was drawn'):
            HandMotion(Tremor(**part), Refusing())


# Taps.


@st.composite
def taps(draw):
    duration_s = draw(st.floats(1e-3, 0.05))
    gaps_s = draw(st.lists(st.floats(0.0, 0.3), min_size=1, max_size=5))
    begins_s = np.cumsum(np.array(gaps_s) + duration_s * (1 + 1e-9))
    return Taps(times_s=begins_s, duration_s=duration_s, peak_force_n=draw(st.floats(-5, 5)))


@given(taps())
def test_taps_are_half_sines_and_nothing_outside_their_time(tapping):
    t = times_s(2.0, 5000.0)
    force_n = tapped_n(tapping, t)
    expected_n = np.zeros(len(t))
    for begin_s in tapping.times_s:
        u = (t - begin_s) / tapping.duration_s
        inside = (u >= 0) & (u < 1)
        expected_n[inside] = tapping.peak_force_n * np.sin(np.pi * u[inside])
    np.testing.assert_allclose(force_n, expected_n, atol=1e-9)
    np.testing.assert_array_equal(force_n[expected_n == 0.0], 0.0)


def test_a_tap_has_its_impulse_and_its_peak():
    tapping = Taps(times_s=[0.2, 0.21], duration_s=0.01, peak_force_n=3.0)
    t = times_s(0.5, 1e5)
    force_n = tapped_n(tapping, t)
    assert np.sum(force_n) / 1e5 == pytest.approx(2 * (2 / np.pi * 3.0 * 0.01), rel=1e-5)
    assert force_n.max() == pytest.approx(3.0)
    assert force_n.min() >= 0.0
    assert not force_n[(t < 0.2 - 1e-9) | (t > 0.22 + 1e-9)].any()


def test_at_the_ends_of_a_tap_the_side_says_what_is_meant():
    numbers = Taps(times_s=[0.25], duration_s=0.5, peak_force_n=2.0).numbers()
    assert tap_force_at(0.75, 0.8, numbers) == 0.0
    assert tap_force_at(0.75, 0.5, numbers) == pytest.approx(0.0, abs=1e-15)
    assert tap_force_at(0.5, 0.7, numbers) == 2.0
    assert tap_force_at(0.5, 0.1, numbers) == 0.0


# Rolling.

ROLLING = st.builds(
    Rolling,
    start_s=st.floats(0, 2),
    duration_s=st.floats(0.05, 1),
    hold_s=st.floats(0, 0.5),
    distance_m=st.tuples(st.floats(-5e-3, 5e-3), st.floats(-5e-3, 5e-3)),
    repeats=st.integers(1, 7),
)


@given(ROLLING)
def test_rolling_goes_to_the_far_end_and_returns_each_time(rolling):
    there_s = rolling.start_s + rolling.duration_s
    back_s = there_s + rolling.hold_s + rolling.duration_s
    cycle_s = 2 * (rolling.duration_s + rolling.hold_s)
    cycles_s = cycle_s * np.arange(rolling.repeats)
    rests_s = np.linspace(0, rolling.hold_s, 5)
    for rest_s in rests_s:
        far_m = rolled_m(rolling, there_s + rest_s + cycles_s)
        np.testing.assert_allclose(far_m, np.tile(rolling.distance_m, (len(far_m), 1)), atol=1e-12)
        np.testing.assert_allclose(rolled_m(rolling, back_s + rest_s + cycles_s), 0.0, atol=1e-12)
    end_s = rolling.start_s + rolling.repeats * cycle_s
    outside_s = np.concatenate([np.linspace(0, rolling.start_s, 20), end_s + np.arange(20) / 7])
    np.testing.assert_array_equal(rolled_m(rolling, outside_s), 0.0)


@given(ROLLING)
def test_rolling_has_no_jump_in_position_or_velocity(rolling):
    h = 1e-5
    t = times_s(rolling.start_s + 2 * rolling.repeats * (rolling.duration_s + rolling.hold_s) + 1)
    velocity_m_s = np.diff([rolled_m(rolling, t + k * h) for k in (-1, 0, 1)], axis=0) / h
    # 3 u^2 - 2 u^3 has a slope of at most 3/2 and a curvature of at most 6.
    distance_m = np.abs(rolling.distance_m)
    assert np.all(np.abs(velocity_m_s) <= 1.5 * distance_m / rolling.duration_s + 1e-9)
    change_m_s = np.abs(velocity_m_s[1] - velocity_m_s[0])
    assert np.all(change_m_s <= 6 * distance_m * h / rolling.duration_s**2 + 1e-9)


@given(ROLLING)
def test_between_its_corners_rolling_is_a_cubic(rolling):
    end_s = rolling.start_s + 2 * rolling.repeats * (rolling.duration_s + rolling.hold_s) + 1.0
    corners_s = rolling.corners_s(end_s)
    edges_s = np.unique([0.0, *corners_s, end_s])
    for from_s, to_s in itertools.pairwise(edges_s):
        within_m = rolled_m(rolling, np.linspace(from_s, to_s, 9)[1:-1])
        np.testing.assert_allclose(np.diff(within_m, 4, axis=0), 0.0, atol=1e-12)
    # A scene that ends before need not know the others.
    early_s = rolling.corners_s(rolling.start_s + 1e-6)
    np.testing.assert_array_equal(early_s, corners_s[:4])
    assert not len(rolling.corners_s(rolling.start_s - 1e-6))


def test_rolling_moves_along_a_straight_line():
    rolling = Rolling(distance_m=[1e-3, -2e-3])
    x, y = rolled_m(rolling, times_s(3.0)).T
    np.testing.assert_allclose(y, -2 * x)
    assert np.all(np.diff(x[(times_s(3.0) > 1.0) & (times_s(3.0) < 1.5)]) > 0.0)


# Faults.

ALL_FAULTS = {'dead_channels': [3], 'flat_channels': [1, 16], 'noisy_channels': [7, 5]}


def sampled(faults, t, cuts=(), lowest_v=0.0, bits=0):
    """Sample noisy volts with faults, in any cut, as a scene does."""
    clean_v = 4.0 + 0.1 * np.sin(t[:, np.newaxis] * np.arange(20.0, 20.0 + PAPER_CHANNELS))
    electronics = Electronics(adc_bits=bits)
    frontend, channels = Frontend(electronics, trial(1)), None
    if faults is not None:
        channels = FaultyChannels(faults, trial(2), lowest_v)
    pieces = []
    for piece_v, piece_s in zip(np.split(clean_v, cuts), np.split(t, cuts), strict=True):
        if channels is None:
            pieces.append(frontend.sample(piece_v, 1 / RATE_HZ))
        else:
            disturbed_v = channels.before_converter(piece_v, piece_s)
            volts = frontend.sample(disturbed_v, 1 / RATE_HZ)
            pieces.append(channels.after_converter(volts, piece_s))
    return np.concatenate(pieces)


@given(CUTS, st.floats(0, 0.7))
def test_any_cut_of_rows_with_faults_gives_the_same_bits(cuts, from_s):
    faults, t = Faults(from_s=from_s, **ALL_FAULTS), times_s(0.6)
    assert sampled(faults, t, cuts).tobytes() == sampled(faults, t).tobytes()


@given(st.floats(0, 0.7))
def test_channels_fail_from_their_time_on_and_the_others_never(from_s):
    t = times_s(0.6)
    sound, faulty = sampled(None, t), sampled(Faults(from_s=from_s, **ALL_FAULTS), t, lowest_v=0.5)
    failed = t >= from_s
    np.testing.assert_array_equal(faulty[~failed], sound[~failed])
    failing = np.isin(np.arange(1, 17), [1, 3, 5, 7, 16])
    np.testing.assert_array_equal(faulty[:, ~failing], sound[:, ~failing])
    if failed.any():
        first = np.argmax(failed)
        assert np.all(faulty[failed, 2] == 0.5)
        for flat in (0, 15):
            assert np.all(faulty[failed, flat] == sound[first, flat])
        assert np.all(faulty[failed][:, [4, 6]] != sound[failed][:, [4, 6]])


def test_noisy_channels_have_so_much_more_noise_independent_of_each_other():
    t = times_s(20.0)
    faults = Faults(noisy_channels=[5, 7], noise_v=0.02)
    extra_v = (sampled(faults, t) - sampled(None, t))[:, [4, 6]]
    np.testing.assert_allclose(extra_v.std(0), 0.02, rtol=0.05)
    assert abs(np.corrcoef(extra_v.T)[0, 1]) < 0.06


def test_the_converter_quantises_the_noise_and_a_flat_channel_holds_a_code():
    volts = sampled(Faults(noise_v=0.5, **ALL_FAULTS), times_s(2.0), bits=8)
    codes = volts / (5.0 / 255)
    np.testing.assert_allclose(codes, np.rint(codes), atol=1e-9)
    assert volts.max() == 5.0


def test_rows_are_never_changed_in_place_and_nothing_is_drawn_without_noise():
    t, clean_v = times_s(0.1), np.full((38, PAPER_CHANNELS), 4.0)
    quiet = FaultyChannels(Faults(dead_channels=[1], flat_channels=[2]), Refusing(), 0.0)
    assert quiet.before_converter(clean_v, t) is clean_v
    quiet.after_converter(clean_v, t)
    noisy = FaultyChannels(Faults(noisy_channels=[1]), trial(), 0.0)
    noisy.before_converter(clean_v, t)
    assert noisy.after_converter(clean_v, t) is clean_v
    assert np.all(clean_v == 4.0)


# Lost samples.


@given(CUTS, st.integers(0, 99))
def test_any_cut_of_a_lossy_link_loses_the_same_samples(cuts, seed):
    drops = Drops(share=0.3, burst_samples=2.5)
    whole = LossyLink(drops, trial(seed)).kept(600)
    link, edges = LossyLink(drops, trial(seed)), np.concatenate([[0], cuts])
    pieces = [link.kept(n) for n in np.diff(edges)]
    pieces.append(link.kept(600)[: max(0, 600 - edges[-1])])
    np.testing.assert_array_equal(np.concatenate(pieces)[:600], whole)


@settings(max_examples=15)
@given(st.floats(0.01, 0.7), st.floats(1, 20), st.integers(0, 99))
def test_the_share_and_the_bursts_of_lost_samples_are_those_asked_for(share, burst, seed):
    share = min(share, 0.95 * burst / (burst + 1))
    lost = ~LossyLink(Drops(share=share, burst_samples=burst), trial(seed)).kept(100_000)
    begins = np.count_nonzero(np.diff(lost.astype(int), prepend=0) == 1)
    # Bursts and the gaps between them are geometric: their numbers tell the spread of the means.
    tolerance = 6 / np.sqrt(begins)
    assert np.mean(lost) == pytest.approx(share, rel=tolerance)
    assert np.count_nonzero(lost) / begins == pytest.approx(burst, rel=tolerance)


def test_a_burst_of_one_never_loses_two_in_a_row():
    lost = ~LossyLink(Drops(share=0.4), trial()).kept(10_000)
    assert lost.any()
    assert not np.any(lost[1:] & lost[:-1])


def test_without_losses_nothing_is_drawn():
    assert LossyLink(Drops(share=0.0), Refusing()).kept(100).all()
    with pytest.raises(AssertionError, match='something was drawn'):
        LossyLink(Drops(), Refusing()).kept(1)


# What is wrong is said in one line.


@pytest.mark.parametrize(
    ('part', 'parameters', 'said'),
    [
        (Hum, {'frequency_hz': 0}, 'parameter frequency_hz is 0 Hz, allowed: 1 to 1000 Hz'),
        (Hum, {'harmonics': [0.1, -1]}, 'parameter harmonics is -1, allowed: 0 to 10'),
        (Hum, {'harmonics': 0.1}, 'parameter harmonics is 0.1, allowed: a list'),
        (Hum, {'hz': 50}, 'unknown parameter hz = 50; allowed: amplitude_v, frequency_hz, harm'),
        (
            Tremor,
            {'low_hz': 20, 'high_hz': 2},
            'parameter high_hz is 2 Hz, allowed: above low_hz, 20 Hz',
        ),
        (Tremor, {'force_rms_n': -1}, 'parameter force_rms_n is -1 N, allowed: 0 to 100 N'),
        (Taps, {}, 'parameter times_s is empty, allowed: at least one time'),
        (
            Taps,
            {'times_s': [2, 1]},
            'parameter times_s has 1 s after 2 s, allowed: rising, at least duration_s, 0.01 s, '
            'apart',
        ),
        (
            Taps,
            {'times_s': [1, 1.05], 'duration_s': 0.1},
            'parameter times_s has 1.05 s after 1 s, allowed: rising, at least duration_s, 0.1 s, '
            'apart',
        ),
        (Taps, {'times_s': [-1]}, 'parameter times_s is -1 s, allowed: at least one, rising'),
        (Rolling, {'distance_m': [1e-3]}, 'parameter distance_m has 1 numbers, allowed: 2'),
        (Rolling, {'repeats': 0}, 'parameter repeats is 0, allowed: 1 to 1e+06'),
        (Faults, {}, 'flat_channels and noisy_channels are all empty, allowed: at least one'),
        (Faults, {'dead_channels': [0]}, 'parameter dead_channels is 0, allowed: 1 to 16'),
        (Faults, {'flat_channels': [17]}, 'parameter flat_channels is 17, allowed: 1 to 16'),
        (
            Faults,
            {'noisy_channels': [2.5]},
            'parameter noisy_channels is 2.5, allowed: a whole number',
        ),
        (
            Faults,
            {'dead_channels': [2], 'flat_channels': [4, 2]},
            'parameter flat_channels has channel 2, which fails already, allowed: one fault for '
            'a channel',
        ),
        (
            Drops,
            {'share': 0.6},
            'parameter share is 0.6, allowed: at most 0.5 with a burst_samples of 1',
        ),
        (Drops, {'burst_samples': 0}, 'parameter burst_samples is 0, allowed: 1 to 1e+06'),
        (Clock, {'rate_ratio': 0}, 'parameter rate_ratio is 0, allowed: 0.1 to 10'),
    ],
)
def test_a_wrong_parameter_is_named_with_what_is_allowed(part, parameters, said):
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        part.from_parameters(parameters, 'part')
    assert str(caught.value).startswith('part: ')
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    'part',
    [
        Hum(harmonics=[0.5]),
        Tremor(),
        Taps(times_s=[1.0]),
        Rolling(),
        Faults(**ALL_FAULTS),
        Drops(),
        Clock(),
    ],
)
def test_parameters_survive_being_written_and_read(part):
    assert type(part).from_parameters(part.to_parameters()) == part


def test_channel_numbers_are_whole():
    assert Faults(dead_channels=[3.0]).to_parameters()['dead_channels'] == [3]
    assert isinstance(Faults(dead_channels=[3.0]).dead_channels[0], int)
