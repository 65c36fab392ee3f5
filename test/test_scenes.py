"""Scenes: what is named is built, what is not is not, and what is wrong is said in one line."""

import importlib
import pkgutil
import re

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from slip_detector import scenes
from slip_detector.chain import SlipChain
from slip_detector.parameter_sets import ParameterSet
from slip_detector.scenes.motion import Step
from slip_detector.scenes.scene import PARTS, Sampling, Scene, load_scene
from slip_detector.sources import find_scene, shared_folder

ALL = 10**9
SHIPPED = sorted(path.stem for path in (shared_folder() / 'config' / 'scenes').glob('*.yaml'))

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

# Whatever the defaults are: these are the numbers that the tests count on.
COMMON = {
    'motion': {'acceleration_m_s2': 0.5, 'ringing_hz': 20.0, 'ringing_damping': 0.7},
    'contact': {'radius_at_1n_m': 6e-3, 'centre_m': [0.0, 0.0], 'taxel_area_m2': 1e-6},
}
BASELINE_V = 3.0
NEAT = {
    'spread': 0.0, 'noise_v': 0.0, 'baseline_v': [BASELINE_V, BASELINE_V], 'bandwidth_hz': 0.0,
    'normal_along_share': 1.0, 'drift_v': 0.0, 'adc_bits': 0,
}  # fmt: skip
LOAD_ONLY = {**NEAT, 'normal_v_n': -1.0, 'shear_v_n': 0.0}
RIDGES = {'ridge_height_m': 2e-5, 'harmonics': [0.0, 0.0], 'indentation_m': 1e-4}
GRIPPED = [{'duration_s': 0.1, 'force_n': 3.0}, {'duration_s': 0.1, 'carried': 1.0}]


def built(description, seed=0):
    return Scene({**COMMON, **description}, np.random.default_rng(seed))


def play(description, seed=0):
    return built(description, seed).read(ALL)


def shipped(name, seed=0):
    return load_scene(find_scene(name), np.random.default_rng(seed)).read(ALL)


def times_s(samples, rate_hz=380.0):
    return np.arange(len(samples.volts)) / rate_hz


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
    plan, state, drive = scene.plan, scene.state, scene.drive_numbers
    return {
        'friction': len(plan.patches) + state.patches.size + plan.friction.model,
        'texture': len(plan.ridges.amplitudes),
        'roughness': len(plan.rough.heights) + len(plan.rough.integral),
        'object': plan.body.mass_kg + drive.load.force_n.size,
        'rolling': drive.rolling.lasts_s,
        'taps': drive.taps.begins_s.size,
        'tremor': drive.force_lines.amplitude.size + drive.motion_lines.amplitude.size,
        'bandwidth': plan.decay >= 0.0,
    }


def test_every_set_of_parameters_of_the_scenes_is_a_part():
    found = set()
    for module in pkgutil.iter_modules(scenes.__path__, 'slip_detector.scenes.'):
        found |= {
            content
            for content in vars(importlib.import_module(module.name)).values()
            if isinstance(content, type) and issubclass(content, ParameterSet)
        }
    assert found - {ParameterSet} == {*PARTS.values(), Sampling, Step}


def test_what_is_not_named_is_not_built():
    assert set(built({'steps': SHORT}).parts) == {'motion', 'contact'}
    assert not any(sizes(built({'steps': SHORT})).values())
    # Without skin and filter there is nothing to step through between two samples.
    assert built({'steps': SHORT}).plan.steps_per_sample == 1


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
    assert alone.plan.ridges.start_rad == beside.plan.ridges.start_rad
    at_s = np.linspace(0.2, 0.8, 50)
    np.testing.assert_array_equal(alone.force_n(at_s), beside.force_n(at_s))


# Steps, clock, losses, faults.


@given(st.floats(50.0, 5e4), st.floats(1e-5, 1e-2))
@settings(max_examples=30)
def test_a_sample_period_is_cut_into_equal_steps_no_longer_than_asked_for(rate_hz, step_s):
    description = {'steps': [{'duration_s': 0.1}], 'sample_rate_hz': rate_hz, 'step_s': step_s}
    scene = built({**description, 'friction': {}, 'skin': {'mass_kg': 0.0}})
    plan = scene.plan
    assert plan.step_s * plan.steps_per_sample * rate_hz == pytest.approx(1.0)
    assert plan.step_s <= step_s * (1.0 + 1e-6)
    assert plan.steps_per_sample == 1 or plan.step_s > 0.5 * step_s * (1.0 - 1e-6)


def test_skin_that_rings_gets_shorter_steps():
    skin = {'mass_kg': 1e-6, 'damping_n_s_m': 0.001, 'shear_stiffness_n_m': 1e3}
    scene = built(
        {'steps': SHORT, 'friction': {'static_coefficient': 0.5, 'kinetic_coefficient': 0.5},
         'skin': skin, 'step_s': 1e-3}
    )  # fmt: skip
    assert scene.plan.step_s < np.sqrt(1e-6 / 1e3)


def test_skin_that_rings_too_fast_is_refused():
    skin = {'mass_kg': 1e-12, 'damping_n_s_m': 0.0, 'shear_stiffness_n_m': 1e6}
    friction = {'static_coefficient': 0.5, 'kinetic_coefficient': 0.5}
    with pytest.raises(ValueError, match=r'steps for a second, allowed: 2e\+06; a longer step_s'):
        built({'steps': SHORT, 'friction': friction, 'skin': skin})


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


# What is wrong with a scene file is said in one line.


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('sample_rate_hz: 380.0', 'steps is None, allowed: a list of at least one step'),
        ('steps: [3]', 'steps: step 1 is 3, allowed: names and values'),
        (
            'steps: [{duration_s: 1}, {duration_s: 0}]',
            'steps: step 2: parameter duration_s is 0 s, allowed: 0.001 to 36000 s',
        ),
        (
            'motion: {acceleration_m_s2: 0.5}\nsteps: [{duration_s: 0.01, velocity_m_s: 1}]',
            'duration_s 0.01 s is too short to reach 1 m/s, allowed: at least 2 s at 0.5 m/s2',
        ),
        (
            'steps: [{duration_s: 0.001}]',
            'steps: all take 0.001 s, allowed: at least one sample at 380 Hz',
        ),
        (
            'steps: [{}]\ntexture: {spatial_period_m: 0}',
            'texture: parameter spatial_period_m is 0 m, allowed: 1e-06 to 1 m',
        ),
        (
            'steps: [{}]\ntexture: {depth: 0.1}',
            'texture: unknown parameter depth = 0.1; allowed: harmonics, indentation_m',
        ),
        (
            'steps: [{}]\nfriction: {kinetic_coefficient: 0.7, static_coefficient: 0.6}',
            'friction: parameter kinetic_coefficient is 0.7, allowed: above 0 and at most',
        ),
        (
            'steps: [{}]\nfriction: dahl',
            "friction: parameter model is 'dahl', allowed: lugre, coulomb",
        ),
        (
            'steps: [{}]\nskin: {mass_kg: -1}',
            'skin: parameter mass_kg is -1 kg, allowed: 0 to 1 kg',
        ),
        (
            'steps: [{}]\nroughness: {correlation_m: 0}',
            'roughness: parameter correlation_m is 0 m, allowed: 1e-09 to 1 m',
        ),
        (
            'steps: [{}]\nelectronics: {rails_v: [5, 0]}',
            'electronics: parameter rails_v is [5, 0] V, allowed: low below high',
        ),
        (
            'steps: [{}]\ncontact: {centre_m: [0]}',
            'contact: parameter centre_m has 1 numbers, allowed: 2',
        ),
        (
            'steps: [{}]\nhumm: {}',
            'unknown part humm, allowed: steps, sample_rate_hz, step_s, motion, contact, skin, '
            'friction, texture, roughness, object, electronics, hum, tremor, taps, rolling, '
            'faults, drops, clock',
        ),
        ('steps: [{}]\ntexture: [1]', 'texture is [1], allowed: names and values'),
        ('steps: [{}]\ntexture: coulomb', "texture is 'coulomb', allowed: names and values"),
        (
            'steps: [{}]\nsample_rate_hz: 0',
            'parameter sample_rate_hz is 0 Hz, allowed: 1 to 1e+06',
        ),
        ('steps: [{}]\nstep_s: 0', 'parameter step_s is 0 s, allowed: 1e-07 to 1 s'),
        (
            'steps: [{}]\nstep_s: 1.0e-7\nfriction: {}',
            'steps for a second, allowed: 2e+06',
        ),
        ('steps: [{}]\nobject: {}', 'object: falls without friction, allowed: with the part'),
        (
            'steps: [{velocity_m_s: 0.001}]\nobject: {}\nfriction: {}',
            'steps: velocity_m_s is not 0, allowed: 0 with an object',
        ),
        (
            'steps: [{}]\nobject: {}\nfriction: {}\ntexture: {}',
            'electronics: bandwidth_hz is 0, allowed: above 0 with an object and texture',
        ),
        (
            'steps: [{}]\nobject: {mass_kg: 20}\nfriction: {}',
            'object: parameter mass_kg is 20 kg, allowed: 0.001 to 10 kg',
        ),
        (
            'steps: [{carried: 1.0}]',
            'steps: carried and pull_n are for an object, allowed: with that part',
        ),
        (
            'steps: [{pull_n: 1.0}]',
            'steps: carried and pull_n are for an object, allowed: with that part',
        ),
        (
            'steps: [{duration_s: 1, velocity_m_s: 0.08}]\n'
            'texture: {spatial_period_m: 4.0e-4, harmonics: [0, 0]}',
            'which 380 Hz of samples cannot tell from slower; allowed: with bandwidth_hz',
        ),
        (
            'steps: [{force_n: 1}]\nfriction: {kinetic_coefficient: 0.1, static_coefficient: 1, '
            'stribeck_velocity_m_s: 1.0e-6}',
            'friction: falls with velocity by up to',
        ),
        (
            'steps: [{}]\nskin: {damping_n_s_m: 0, mass_kg: 0}\nfriction: {viscous_n_s_m: 0, '
            'kinetic_coefficient: 0.5, static_coefficient: 0.5, bristle_damping_n_s_m: 1}',
            'friction: bristle_damping_n_s_m is 1 N s/m on skin without mass and damping',
        ),
        ('- 1', 'is not a YAML file of names and values'),
        ('steps: [', ' line 1 is not YAML'),
    ],
)
def test_a_wrong_scene_file_is_named_with_part_parameter_and_what_is_allowed(tmp_path, text, said):
    path = tmp_path / 'wrong.yaml'
    path.write_text(text)
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        load_scene(path, np.random.default_rng(0))
    assert str(caught.value).startswith(f'{path}:')
    assert '\n' not in str(caught.value)


def test_a_missing_scene_file_is_named(tmp_path):
    with pytest.raises(ValueError, match=re.escape(f'{tmp_path / "no.yaml"}: cannot be read')):
        load_scene(tmp_path / 'no.yaml', np.random.default_rng(0))


@pytest.mark.parametrize('extra', [{}, {'electronics': {'bandwidth_hz': 1e3}}])
def test_ridges_too_fast_for_the_samples_need_a_bandwidth(extra):
    texture = {**RIDGES, 'spatial_period_m': 400e-6, 'harmonics': [0.1, 0.1]}
    # 100 Hz, of which the third harmonic passes at 300.
    steps = [{'duration_s': 1.0, 'velocity_m_s': 40e-3}]
    description = {'steps': steps, 'texture': texture, 'sample_rate_hz': 599.0, **extra}
    if extra:
        built(description)
        return
    with pytest.raises(ValueError, match=r'^texture: passes at up to 300 Hz, which 599 Hz'):
        built(description)
    built({**description, 'sample_rate_hz': 601.0})


# The scenes that come with the package.


def test_the_scenes_that_are_wanted_are_there():
    wanted = {
        'plate_400um', 'plate_440um', 'plate_480um', 'flat_plate', 'fast_40mm_s', 'fast_80mm_s',
        'taps', 'rolling', 'tremor_hum', 'dead_channel', 'object',
    }  # fmt: skip
    assert wanted <= set(SHIPPED)


@pytest.mark.parametrize('name', SHIPPED)
def test_a_scene_of_the_package_plays_within_its_rails_and_says_what_slips(name):
    scene = load_scene(find_scene(name), np.random.default_rng(0))
    samples = scene.read(ALL)
    assert len(samples.volts) == scene.length
    low_v, high_v = 0.0, 5.0
    assert np.isfinite(samples.volts).all()
    assert samples.volts.min() >= low_v
    assert samples.volts.max() <= high_v
    sound = samples.volts[:, np.arange(16) != 4] if name == 'dead_channel' else samples.volts
    assert np.ptp(sound, axis=0).min() > 0.05  # The contact is felt everywhere.
    assert samples.truth.any() == (name not in ('taps', 'rolling', 'tremor_hum'))


@pytest.mark.parametrize('name', SHIPPED)
def test_a_scene_of_the_package_names_parts_only(name):
    named = set(yaml.safe_load(find_scene(name).read_text()))
    assert named <= {'steps', 'sample_rate_hz', 'step_s', *PARTS}


def test_the_object_of_the_package_is_held_slips_is_caught_and_falls():
    samples = shipped('object')
    t, truth = samples.time_s, samples.truth
    assert not truth[(t > 2.0) & (t < 3.0)].any()
    assert truth[(t > 3.0) & (t < 3.15)].any()
    assert not truth[(t > 3.5) & (t < 4.0)].any()
    assert truth[t > 4.1].any()
    slid_m = np.interp([2.5, 3.9, 5.0], t, samples.position_m)
    assert 1e-4 < slid_m[1] - slid_m[0] < 0.05
    assert slid_m[2] >= 0.1  # Through the fingers and lost.


@pytest.mark.parametrize('seed', range(3))
def test_the_default_chain_finds_the_slip_of_the_default_plate(seed):
    samples = shipped('plate_400um', seed)
    result = SlipChain().update(samples.volts)
    t = times_s(samples)
    slip_s = t[samples.truth]
    assert result.channels[samples.truth].any(axis=0).all()
    assert result.slip[samples.truth].mean() > 0.9
    delay_s = t[np.argmax(result.slip & (t >= slip_s[0]))] - slip_s[0]
    assert 0.0 < delay_s < 0.08
    assert not result.slip[(t < 1.0) | (t > slip_s[-1] + 0.2) & (t < 6.6)].any()
