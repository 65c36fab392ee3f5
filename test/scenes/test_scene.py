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

"""Scenes: what is named is built, what is not is not, and what a trial is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from support.scene_cases import ALL, COMMON, RIDGES, built, shipped, times_s

#: A plate that is touched at 0.1 s, pushed at 0.5 s, let go at 0.9 s.
SHORT = [
    {'duration_s': 0.1},
    {'duration_s': 0.1, 'force_n': 0.4},
    {'duration_s': 0.3},
    {'duration_s': 0.4, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.1, 'force_n': 0.0},
    {'duration_s': 0.2},
]

PUSH_S = 0.5
BASELINE_V = 3.0

NEAT = {
    'spread': 0.0, 'noise_v': 0.0, 'baseline_v': [BASELINE_V, BASELINE_V], 'bandwidth_hz': 0.0,
    'normal_along_share': 1.0, 'drift_v': 0.0, 'adc_bits': 0,
}  # fmt: skip

LOAD_ONLY = {**NEAT, 'normal_v_n': -1.0, 'shear_v_n': 0.0}


def play(description, seed=0):
    return built(description, seed).read(ALL)


def peaks_hz(volts, rate_hz):
    """Return where the spectrum of each channel is highest."""
    windowed = signal.detrend(volts, axis=0) * np.hanning(len(volts))[:, np.newaxis]
    spectrum = np.abs(np.fft.rfft(windowed, n=2**16, axis=0))
    return np.fft.rfftfreq(2**16, 1 / rate_hz)[np.argmax(spectrum, axis=0)]


# Trials.


def test_a_scene_is_as_long_as_its_steps():
    samples = play({'steps': SHORT, 'sample_rate_hz': 1000.0})
    assert [len(field) for field in samples] == [1200] * 4
    np.testing.assert_allclose(samples.time_s, np.arange(1200) / 1000.0)


def test_one_seed_is_one_trial():
    assert shipped('plate_400um', 5).volts.tobytes() == shipped('plate_400um', 5).volts.tobytes()


def test_another_seed_is_other_noise_on_the_same_fingertip():
    noise_v = 0.5e-3
    description = {'steps': [{'duration_s': 5.0}], 'electronics': {'noise_v': noise_v}}
    one, other = play(description, 1).volts, play(description, 2).volts
    assert not np.any(one == other)
    np.testing.assert_allclose(
        one.mean(0), other.mean(0), atol=5 * noise_v * np.sqrt(2 / len(one))
    )
    np.testing.assert_allclose((one - one.mean(0)).std(0), noise_v, rtol=0.1)


def test_another_fingertip_has_other_baselines_and_sensitivities():
    one, other = (
        play({'steps': SHORT[:3], 'electronics': {'noise_v': 0.0, 'fingertip_seed': seed}}).volts
        for seed in (1, 2)
    )
    assert not np.any(one[0] == other[0])
    assert not np.any(one[0] - one[-1] == other[0] - other[-1])


# Volts.


@settings(max_examples=10)
@given(st.floats(-1e4, 1e4), st.floats(0, 1), st.integers(0, 99))
def test_volts_stay_within_the_rails(sensitivity, noise_v, seed):
    electronics = {'normal_v_n': sensitivity, 'noise_v': noise_v, 'rails_v': [0.5, 4.5]}
    volts = play({'steps': SHORT, 'friction': {}, 'electronics': electronics}, seed).volts
    assert volts.min() >= 0.5
    assert volts.max() <= 4.5


def test_a_fingertip_that_rings_off_the_plate_is_free_and_not_pulled():
    steps = [{'duration_s': 0.2, 'force_n': 1.0}, {'duration_s': 0.002, 'force_n': 0.0}]
    steps.append({'duration_s': 0.3})
    motion = {**COMMON['motion'], 'ringing_damping': 0.02}
    volts = play({'steps': steps, 'motion': motion, 'electronics': LOAD_ONLY}).volts
    after = volts[round(0.202 * 380) :, 0]
    assert volts.max() == BASELINE_V
    contact = after < BASELINE_V
    assert np.count_nonzero(np.diff(contact)) >= 4  # It leaves the plate and comes back.


def test_the_bandwidth_takes_off_what_passes_too_fast():
    steps = [*SHORT[:3], {'duration_s': 0.5, 'velocity_m_s': 40e-3}]
    common = {
        'steps': steps,
        'motion': {**COMMON['motion'], 'acceleration_m_s2': 2.0},
        'friction': {},
        'texture': {**RIDGES, 'spatial_period_m': 400e-6},
        'sample_rate_hz': 2000.0,
    }
    wide, narrow = (
        np.ptp(play({**common, 'electronics': {**LOAD_ONLY, 'bandwidth_hz': hz}}).volts[1600:], 0)
        for hz in (0.0, 20.0)
    )
    # 100 Hz through a first-order low-pass with its corner at 20 Hz.
    np.testing.assert_allclose(narrow / wide, 1.0 / np.hypot(1.0, 100.0 / 20.0), rtol=0.05)


# Truth.


def test_truth_is_the_motion_of_the_platform():
    samples = shipped('plate_400um')
    moved = np.diff(samples.position_m) != 0.0
    before, after, truth = moved[:-1], moved[1:], samples.truth[1:-1]
    assert np.all(truth[before & after])
    assert not np.any(truth[~before & ~after])
    assert np.count_nonzero(truth) == pytest.approx(2.5 * 380, abs=20)


def test_motion_without_contact_is_no_slip():
    samples = play({'steps': [{'duration_s': 0.5, 'velocity_m_s': 5e-3}], 'friction': {}})
    assert samples.position_m[-1] > 2e-3
    assert not samples.truth.any()


def test_motion_back_is_slip_too():
    steps = [*SHORT[:3], {'duration_s': 0.4, 'velocity_m_s': -6.7e-3}]
    samples = play({'steps': steps, 'friction': {}})
    assert samples.position_m[-1] < -2e-3
    assert samples.truth[times_s(samples) > 0.51].all()


# Texture under a moving plate.


@settings(max_examples=10)
@given(st.floats(2e-3, 30e-3), st.floats(10.0, 150.0))
def test_a_sliding_channel_shows_the_ridges_at_velocity_over_spatial_period(velocity_m_s, hz):
    steps = [{'duration_s': 0.1, 'force_n': 0.4}, {'duration_s': 0.3}]
    steps.append({'duration_s': 1.2, 'velocity_m_s': velocity_m_s})
    # Without harmonics that half of the sample rate could not carry.
    texture = {**RIDGES, 'spatial_period_m': velocity_m_s / hz}
    electronics = {'bandwidth_hz': 500.0, 'noise_v': 0.5e-3}
    samples = play(
        {'steps': steps, 'friction': {}, 'texture': texture, 'electronics': electronics}
    )
    sliding = times_s(samples) > 0.6
    np.testing.assert_allclose(peaks_hz(samples.volts[sliding], 380.0), hz, atol=0.3)


def test_the_ridges_vary_the_load_by_their_height_over_the_indentation():
    common = {'steps': SHORT, 'sample_rate_hz': 5000.0, 'electronics': LOAD_ONLY, 'friction': {}}
    smooth, ridged = (
        BASELINE_V - play({**common, **part}).volts for part in ({}, {'texture': RIDGES})
    )
    sliding = slice(round(0.55 * 5000), round(0.85 * 5000))
    factor = ridged[sliding] / smooth[sliding]
    np.testing.assert_allclose(factor.max(0), 1.2, rtol=1e-3)
    np.testing.assert_allclose(factor.min(0), 0.8, rtol=1e-3)


def test_a_taxel_that_sticks_keeps_its_place_on_the_ridges():
    # A push of some 20 um is taken up by the skin: no taxel slides, so none passes a ridge.
    steps = [*SHORT[:3], {'duration_s': 0.01, 'velocity_m_s': 2e-3}]
    steps += [{'duration_s': 0.2, 'velocity_m_s': 0.0}]
    common = {
        'steps': steps, 'electronics': LOAD_ONLY, 'texture': {**RIDGES, 'spatial_period_m': 8e-5},
    }  # fmt: skip
    stuck, free = (
        play({**common, 'friction': {'model': 'coulomb', 'kinetic_coefficient': coefficient}})
        for coefficient in (5.0, 0.01)
    )
    assert stuck.position_m[-1] == pytest.approx(20e-6, rel=0.5)
    last = times_s(stuck) > 0.53
    still = (times_s(stuck) > 0.45) & (times_s(stuck) < 0.5)
    moved = [np.abs(one.volts[last].mean(0) - one.volts[still].mean(0)) for one in (stuck, free)]
    assert moved[0].max() < 0.05 * moved[1].max()


# Parts that are not named are not built.


def moving_and_still(**parts):
    still = [dict(step) for step in SHORT]
    still[3]['velocity_m_s'] = 0.0
    moving, at_rest = play({'steps': SHORT, **parts}), play({'steps': still, **parts})
    assert moving.truth.any()
    assert not at_rest.truth.any()
    return moving.volts, at_rest.volts


def test_without_friction_and_texture_motion_is_not_felt():
    moving, still = moving_and_still()
    assert moving.tobytes() == still.tobytes()


@pytest.mark.parametrize(
    'part', [{'friction': {}}, {'friction': 'coulomb'}, {'texture': RIDGES}, {'roughness': {}}]
)
def test_with_friction_or_texture_motion_is_felt_from_the_push_on(part):
    moving, still = moving_and_still(**part, electronics={'noise_v': 0.0})
    push = int(PUSH_S * 380)
    assert moving[:push].tobytes() == still[:push].tobytes()
    assert np.abs(moving - still)[push + 20 : push + 140].max(axis=0).min() > 0.0


def sizes(scene):
    """Return how much of each part that may be left out has been built."""
    constants, state, drive = scene.constants, scene.state, scene.drive_numbers
    return {
        'friction': len(constants.patches) + state.patches.size + constants.friction.model,
        'texture': len(constants.ridges.amplitudes),
        'roughness': len(constants.rough.heights) + len(constants.rough.integral),
        'object': constants.body.mass_kg + drive.load.size,
        'rolling': drive.rolling.size,
        'taps': drive.taps.begins_s.size,
        'tremor': drive.force_sines.size + drive.motion_sines.size,
        'bandwidth': constants.decay >= 0.0,
    }


def test_what_is_not_named_is_not_built():
    assert set(built({'steps': SHORT}).parts) == {'motion', 'contact'}
    assert not any(sizes(built({'steps': SHORT})).values())
    # Without skin and filter there is nothing to step through between two samples.
    assert built({'steps': SHORT}).constants.steps_per_sample == 1


@pytest.mark.parametrize(
    ('part', 'content'),
    [
        ('friction', {}),
        ('friction', 'coulomb'),
        ('texture', RIDGES),
        ('roughness', {}),
        ('rolling', {}),
        ('taps', {'times_s': [0.3]}),
        ('tremor', {}),
        ('electronics', {'bandwidth_hz': 100.0}),
    ],
)
def test_a_part_that_is_named_is_built_and_no_other(part, content):
    built_sizes = sizes(built({'steps': SHORT, part: content}))
    name = 'bandwidth' if part == 'electronics' else part
    assert built_sizes.pop(name)
    assert not any(built_sizes.values())


def test_friction_none_is_no_friction():
    none, absent = (built({'steps': SHORT, **part}) for part in ({'friction': 'none'}, {}))
    assert 'friction' not in none.parts
    assert not any(sizes(none).values())
    assert none.read(ALL).volts.tobytes() == absent.read(ALL).volts.tobytes()


def test_coulomb_has_no_bristles_that_bend():
    scene = built({'steps': SHORT, 'friction': 'coulomb'})
    scene.clean(300)
    assert np.abs(scene.state.patches[:, 0]).max() > 0.0
    np.testing.assert_array_equal(scene.state.patches[:, 2], 0.0)


def test_a_part_that_is_named_without_values_has_its_defaults():
    named = play({'steps': SHORT, 'friction': None})
    assert named.volts.tobytes() == play({'steps': SHORT, 'friction': {}}).volts.tobytes()
    assert named.volts.tobytes() != play({'steps': SHORT}).volts.tobytes()


#: One of each part that draws from the trial's generator, and one that does not.
OPTIONAL = {
    'texture': RIDGES,
    'hum': {},
    'tremor': {},
    'faults': {'noisy_channels': [7]},
    'drops': {'share': 0.3},
    'taps': {'times_s': [0.3]},
}


@pytest.mark.parametrize('left_out', OPTIONAL)
def test_leaving_one_part_out_leaves_the_noise_of_the_others(left_out):
    # No sensitivities: what is left of the volts is electronics and what disturbs them.
    common = {
        'steps': SHORT,
        'electronics': {'normal_v_n': 0.0, 'shear_v_n': 0.0, 'noise_v': 1e-3, 'drift_v': 1e-3},
    }
    whole = play({**common, **OPTIONAL})
    less = play({**common, **{name: of for name, of in OPTIONAL.items() if name != left_out}})
    if left_out == 'drops':
        kept = np.isin(less.time_s, whole.time_s)
        assert not kept.all()
        assert less.volts[kept].tobytes() == whole.volts.tobytes()
        return
    assert less.time_s.tobytes() == whole.time_s.tobytes()
    if left_out == 'hum':
        off = whole.volts - less.volts
        np.testing.assert_allclose(off, off[:, :1] * np.ones(16), atol=1e-12)
        assert np.abs(off).max() > 0.0
        return
    others = np.arange(16) != 6 if left_out == 'faults' else slice(None)
    assert less.volts[:, others].tobytes() == whole.volts[:, others].tobytes()


def test_texture_and_tremor_keep_their_phase_whatever_else_there_is():
    common = {'steps': SHORT, 'texture': RIDGES, 'tremor': {}, 'electronics': LOAD_ONLY}
    alone, beside = (
        built({**common, **more}, 3) for more in ({}, {'hum': {}, 'drops': {}, 'friction': {}})
    )
    assert alone.constants.ridges.start_rad == beside.constants.ridges.start_rad
    at_s = np.linspace(0.2, 0.8, 50)
    np.testing.assert_array_equal(alone.force_n(at_s), beside.force_n(at_s))


# Steps, clock, losses, faults.


def test_a_clock_that_is_wrong_says_one_rate_and_samples_at_another():
    scene = built({'steps': SHORT, 'clock': {'rate_ratio': 1.25}, 'sample_rate_hz': 400.0})
    assert scene.sample_rate_hz == 400.0
    samples = scene.read(ALL)
    np.testing.assert_allclose(samples.time_s, np.arange(600) / 500.0)


def test_lost_samples_are_missing_and_the_others_keep_their_times():
    common = {'steps': SHORT, 'friction': {}, 'clock': {'rate_ratio': 0.9}}
    whole, lossy = play(common), play({**common, 'drops': {'share': 0.2, 'burst_samples': 2}})
    kept = np.isin(whole.time_s, lossy.time_s)
    assert 0.6 < kept.mean() < 0.95
    for every, left in zip(whole, lossy, strict=True):
        assert every[kept].tobytes() == left.tobytes()


def test_a_dead_channel_reads_the_low_rail_and_the_others_go_on():
    common = {'steps': SHORT, 'friction': {}, 'electronics': {'rails_v': [0.25, 5.0]}}
    sound = play(common)
    dead = play({**common, 'faults': {'dead_channels': [5], 'from_s': 0.3}})
    late = sound.time_s >= 0.3
    np.testing.assert_array_equal(dead.volts[late, 4], 0.25)
    assert dead.volts[~late].tobytes() == sound.volts[~late].tobytes()
    others = np.arange(16) != 4
    assert dead.volts[:, others].tobytes() == sound.volts[:, others].tobytes()
