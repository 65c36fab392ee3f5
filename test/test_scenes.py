"""The simulated fingertip: what a scene shows is what its parts say."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from slip_detector import fingertip
from slip_detector.chain import SlipChain
from slip_detector.scenes.contact import Contact
from slip_detector.scenes.motion import Motion, Platform, Step
from slip_detector.scenes.scene import Scene, load_scene
from slip_detector.sources import find_scene

ALL = 10**9

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

# Electronics that show one thing at a time, to be solved for it.
BASELINE_V = 3.0
NEAT = {'spread': 0.0, 'noise_v': 0.0, 'baseline_v': [BASELINE_V, BASELINE_V]}
LOAD_ONLY = {**NEAT, 'normal_v_n': -1.0, 'shear_v_n': 0.0}
SHEAR_ONLY = {**NEAT, 'normal_v_n': 0.0, 'shear_v_n': 1.0, 'shear_along_share': 1.0}


def play(description, seed=0):
    return Scene(description, np.random.default_rng(seed)).read(ALL)


def times_s(samples, rate_hz=380.0):
    return np.arange(len(samples.volts)) / rate_hz


def plate(seed=0):
    return load_scene(find_scene('plate_400um'), np.random.default_rng(seed)).read(ALL)


def peaks_hz(volts, rate_hz):
    """Return where the spectrum of each channel is highest."""
    windowed = signal.detrend(volts, axis=0) * np.hanning(len(volts))[:, np.newaxis]
    spectrum = np.abs(np.fft.rfft(windowed, n=2**16, axis=0))
    return np.fft.rfftfreq(2**16, 1 / rate_hz)[np.argmax(spectrum, axis=0)]


# Reading.


@given(st.lists(st.integers(0, 200), max_size=15))
def test_any_cut_of_a_scene_gives_the_same_bits(cuts):
    description = {'steps': SHORT, 'friction': {}, 'texture': {}}
    whole = play(description)
    scene = Scene(description, np.random.default_rng(0))
    pieces = [scene.read(n) for n in [*cuts, ALL, 1]]
    for name in ('volts', 'truth', 'position_m'):
        joined = np.concatenate([getattr(piece, name) for piece in pieces])
        assert joined.tobytes() == getattr(whole, name).tobytes(), name
    assert len(pieces[-1].volts) == 0


def test_a_scene_is_as_long_as_its_steps():
    samples = play({'steps': SHORT, 'sample_rate_hz': 1000.0})
    assert len(samples.volts) == len(samples.truth) == len(samples.position_m) == 1200


def test_one_seed_is_one_trial():
    assert plate(5).volts.tobytes() == plate(5).volts.tobytes()


def test_another_seed_is_other_noise_on_the_same_fingertip():
    description = {'steps': [{'duration_s': 5.0}]}
    one, other = play(description, 1).volts, play(description, 2).volts
    assert not np.any(one == other)
    np.testing.assert_allclose(one.mean(0), other.mean(0), atol=5 * 0.5e-3 * np.sqrt(2 / len(one)))
    np.testing.assert_allclose((one - one.mean(0)).std(0), 0.5e-3, rtol=0.1)


def test_another_fingertip_has_other_baselines_and_sensitivities():
    steps = SHORT[:3]
    quiet = {'noise_v': 0.0}
    one, other = (
        play({'steps': steps, 'electronics': {**quiet, 'fingertip_seed': seed}}).volts
        for seed in (1, 2)
    )
    assert not np.any(one[0] == other[0])
    assert not np.any(one[0] - one[-1] == other[0] - other[-1])


# Baseline and rails.


def test_the_baseline_lies_within_its_range_until_contact():
    samples = plate()
    before = samples.volts[times_s(samples) < 1.0]
    assert np.all((before.mean(0) >= 4.3) & (before.mean(0) <= 4.35))
    assert np.ptp(before.mean(0)) > 0.01
    # One sample may be off by its noise, here by no more than six standard deviations.
    assert before.min() > 4.3 - 3e-3
    assert before.max() < 4.35 + 3e-3


@given(st.floats(-1e4, 1e4), st.floats(0, 1), st.integers(0, 99))
def test_volts_stay_within_the_rails(sensitivity, noise_v, seed):
    electronics = {'normal_v_n': sensitivity, 'noise_v': noise_v, 'rails_v': [0.5, 4.5]}
    volts = play({'steps': SHORT, 'friction': {}, 'electronics': electronics}, seed).volts
    assert volts.min() >= 0.5
    assert volts.max() <= 4.5


def test_a_load_beyond_the_rail_shows_the_rail():
    volts = play({'steps': SHORT, 'electronics': {'normal_v_n': -1e4}}).volts
    assert np.all(volts.min(0) == 0.0)


# Contact.


@settings(max_examples=25)
@given(
    st.floats(0.05, 5.0),
    st.floats(1e-3, 1e-2),
    st.tuples(st.floats(-3e-3, 3e-3), st.floats(-3e-3, 3e-3)),
)
def test_the_pressure_integrates_to_the_normal_force(force_n, radius_m, centre_m):
    contact = Contact(radius_at_1n_m=radius_m, centre_m=centre_m)
    reach_m = 1.1 * radius_m * force_n ** (1 / 3)
    axis, step = np.linspace(-reach_m, reach_m, 201, retstep=True)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2) + centre_m
    loads_n = contact.loads_n(np.array([force_n]), grid)
    assert loads_n.sum() / contact.taxel_area_m2 * step**2 == pytest.approx(force_n, rel=0.01)


def test_a_taxel_outside_the_contact_carries_nothing_and_the_middle_most():
    contact = Contact(radius_at_1n_m=2e-3)
    along = np.column_stack([np.linspace(0, 4e-3, 41), np.zeros(41)])
    loads_n = contact.loads_n(np.array([0.0, 1.0]), along)
    assert np.all(loads_n[0] == 0.0)
    assert np.all(np.diff(loads_n[1, :20]) < 0.0)
    assert np.all(loads_n[1, 21:] == 0.0)


def test_the_contact_grows_with_the_cube_root_of_the_force():
    contact = Contact(radius_at_1n_m=1e-3)
    at = np.array([[1.99e-3, 0.0], [2.01e-3, 0.0]])
    np.testing.assert_array_equal(contact.loads_n(np.array([8.0]), at) > 0.0, [[True, False]])


@given(
    st.lists(
        st.builds(Step, duration_s=st.floats(0.01, 0.3), force_n=st.floats(0, 5)), min_size=1
    ),
    st.floats(1, 60),
    st.floats(0.01, 2),
)
def test_the_force_is_never_negative(steps, ringing_hz, damping):
    motion = Motion(ringing_hz=ringing_hz, ringing_damping=damping)
    platform = Platform(motion, steps, 1000.0)
    force_n = platform.force_n(np.arange(2000) / 1000.0)
    assert force_n.min() >= 0.0
    assert np.isfinite(force_n).all()


def test_a_fingertip_that_rings_off_the_plate_is_free_and_not_pulled():
    steps = [{'duration_s': 0.2, 'force_n': 1.0}, {'duration_s': 0.002, 'force_n': 0.0}]
    steps.append({'duration_s': 0.3})
    motion = {'ringing_damping': 0.02}
    volts = play({'steps': steps, 'motion': motion, 'electronics': LOAD_ONLY}).volts
    after = volts[round(0.202 * 380) :, 0]
    assert volts.max() == BASELINE_V
    contact = after < BASELINE_V
    assert np.count_nonzero(np.diff(contact)) >= 4  # It leaves the plate and comes back.


def test_the_force_settles_at_what_the_step_says():
    steps = [Step(0.1, 2.0), Step(1.0), Step(0.1, 0.5), Step(1.0)]
    force_n = Platform(Motion(), steps, 1000.0).force_n(np.arange(2200) / 1000.0)
    assert force_n[1090] == pytest.approx(2.0, rel=1e-3)
    assert force_n[2190] == pytest.approx(0.5, rel=1e-3)
    assert force_n.max() > 2.05  # It rings, being underdamped.


# Motion and truth.


def test_the_plate_moves_as_the_steps_say():
    samples = plate()
    # Each ramp between two velocities loses or gains the square of the change / (2 a).
    ramps_m = (-(6.7e-3**2) - 3.3e-3**2 + 10e-3**2) / (2 * 0.5)
    assert samples.position_m[-1] == pytest.approx(6.7e-3 * 1.5 + 10e-3 * 1.0 + ramps_m)
    t, x = times_s(samples), samples.position_m
    for start, stop, velocity in [(3.9, 5.2, 6.7e-3), (5.4, 6.2, 10e-3)]:
        inside = (t > start) & (t < stop)
        np.testing.assert_allclose(np.diff(x[inside]) * 380.0, velocity, rtol=1e-9)


def test_truth_is_the_motion_of_the_platform():
    samples = plate()
    moved = np.diff(samples.position_m) != 0.0
    before, after, truth = moved[:-1], moved[1:], samples.truth[1:-1]
    assert np.all(truth[before & after])
    assert not np.any(truth[~before & ~after])
    assert np.count_nonzero(truth) == pytest.approx(2.5 * 380, abs=10)


def test_motion_without_contact_is_no_slip():
    samples = play({'steps': [{'duration_s': 0.5, 'velocity_m_s': 5e-3}], 'friction': {}})
    assert samples.position_m[-1] > 2e-3
    assert not samples.truth.any()


def test_motion_back_is_slip_too():
    steps = [*SHORT[:3], {'duration_s': 0.4, 'velocity_m_s': -6.7e-3}]
    samples = play({'steps': steps, 'friction': {}})
    assert samples.position_m[-1] < -2e-3
    assert samples.truth[times_s(samples) > 0.51].all()


# Friction.

RATE = 5000.0  # Sliding begins within some 10 ms: too few rows at 380 Hz.
MU, STIFFNESS_N_M = 0.5, 170.0


def loads_and_shears_n(**more):
    """Play one scene twice: once the volts show the loads and once the shears."""
    common = {
        'steps': SHORT,
        'sample_rate_hz': RATE,
        'friction': {'coefficient': MU, 'shear_stiffness_n_m': STIFFNESS_N_M},
        **more,
    }
    loaded = play({**common, 'electronics': LOAD_ONLY})
    sheared = play({**common, 'electronics': SHEAR_ONLY})
    return loaded, BASELINE_V - loaded.volts, sheared.volts - BASELINE_V


def slides(loads_n, shears_n):
    return np.isclose(np.abs(shears_n), MU * loads_n, rtol=0.0, atol=1e-12)


def test_shear_is_elastic_then_limited_by_friction_times_load():
    samples, loads_n, shears_n = loads_and_shears_n()
    held = (times_s(samples, RATE) >= PUSH_S) & (times_s(samples, RATE) < 0.88)
    loads_n, shears_n = loads_n[held], shears_n[held]
    elastic_n = STIFFNESS_N_M * samples.position_m[held][:, np.newaxis]
    sliding = slides(loads_n, shears_n)
    assert sliding.any(axis=0).all()
    assert (~sliding).any(axis=0).all()
    assert not np.any(np.diff(sliding.astype(int), axis=0) < 0)  # Who slides goes on sliding.
    np.testing.assert_allclose(
        shears_n[~sliding], np.broadcast_to(elastic_n, shears_n.shape)[~sliding], atol=1e-12
    )
    assert np.all(elastic_n.T[0][:, np.newaxis] >= shears_n - 1e-12)


def test_shear_never_exceeds_friction_times_load():
    _, loads_n, shears_n = loads_and_shears_n()
    assert np.all(np.abs(shears_n) <= MU * loads_n + 1e-12)
    assert np.all(shears_n[-1] == 0.0)  # Nothing is left of it when the plate is gone.


def test_the_taxels_at_the_edge_slide_before_those_in_the_centre():
    samples, loads_n, shears_n = loads_and_shears_n()
    pushed = times_s(samples, RATE) > PUSH_S
    first = np.argmax(slides(loads_n, shears_n)[pushed], axis=0)
    distance_m = np.hypot(*fingertip.taxel_positions().T)
    order = np.argsort(distance_m)[::-1]
    assert np.all(np.diff(first[order]) >= 0)
    assert first[order[-1]] > first[order[0]]


def test_shear_along_the_finger_is_felt_by_its_share():
    electronics = {**SHEAR_ONLY, 'shear_along_share': 0.25}
    _, _, shears_n = loads_and_shears_n()
    common = {'coefficient': MU, 'shear_stiffness_n_m': STIFFNESS_N_M}
    part = play(
        {'steps': SHORT, 'sample_rate_hz': RATE, 'friction': common, 'electronics': electronics}
    )
    across = [c - 1 for c in fingertip.GROUPS['TP'] + fingertip.GROUPS['TD']]
    along = [c - 1 for c in fingertip.GROUPS['LR'] + fingertip.GROUPS['LU']]
    felt = part.volts - BASELINE_V
    assert shears_n.max() > 1e-3
    np.testing.assert_allclose(felt[:, across], shears_n[:, across], atol=1e-12)
    np.testing.assert_allclose(felt[:, along], 0.25 * shears_n[:, along], atol=1e-12)


# Texture.


@pytest.mark.parametrize(
    ('start_s', 'stop_s', 'hz'), [(3.95, 5.25, 6.7 / 0.4), (5.4, 6.25, 10.0 / 0.4)]
)
def test_a_sliding_channel_shows_the_ridges_at_velocity_over_spatial_period(start_s, stop_s, hz):
    samples = plate()
    sliding = (times_s(samples) > start_s) & (times_s(samples) < stop_s)
    np.testing.assert_allclose(peaks_hz(samples.volts[sliding], 380.0), hz, atol=0.3)


@settings(max_examples=20)
@given(st.floats(2e-3, 30e-3), st.floats(10.0, 150.0))
def test_the_ridges_pass_at_velocity_over_spatial_period(velocity_m_s, hz):
    steps = [{'duration_s': 0.1, 'force_n': 0.4}, {'duration_s': 0.3}]
    steps.append({'duration_s': 1.2, 'velocity_m_s': velocity_m_s})
    texture = {'spatial_period_m': velocity_m_s / hz, 'depth': 0.1}
    samples = play({'steps': steps, 'friction': {}, 'texture': texture})
    sliding = times_s(samples) > 0.6
    np.testing.assert_allclose(peaks_hz(samples.volts[sliding], 380.0), hz, atol=0.3)


def test_the_depth_is_the_share_of_the_load_that_varies():
    depth = 0.18
    common = {'steps': SHORT, 'sample_rate_hz': RATE, 'electronics': LOAD_ONLY, 'friction': {}}
    smooth, ridged = (
        BASELINE_V - play({**common, **part}).volts for part in ({}, {'texture': {'depth': depth}})
    )
    sliding = slice(round(0.55 * RATE), round(0.85 * RATE))
    factor = ridged[sliding] / smooth[sliding]
    np.testing.assert_allclose(factor.max(0), 1 + depth, rtol=1e-3)
    np.testing.assert_allclose(factor.min(0), 1 - depth, rtol=1e-3)


def test_a_taxel_that_sticks_keeps_its_place_on_the_ridges():
    # A push of 20 um is taken up by the skin: no taxel slides, so none passes a ridge.
    steps = [*SHORT[:3], {'duration_s': 0.01, 'velocity_m_s': 2e-3}]
    steps += [{'duration_s': 0.2, 'velocity_m_s': 0.0}]
    common = {'steps': steps, 'electronics': LOAD_ONLY, 'texture': {'spatial_period_m': 40e-6}}
    stuck = play({**common, 'friction': {'coefficient': 5.0}})
    free = play({**common, 'friction': {'coefficient': 0.01}})
    assert stuck.position_m[-1] == pytest.approx(20e-6, rel=0.5)
    last = times_s(stuck) > 0.48
    assert np.ptp(stuck.volts[last], axis=0).max() < 1e-5
    assert np.ptp(free.volts[last], axis=0).min() > 1e-4


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


@pytest.mark.parametrize('part', ['friction', 'texture'])
def test_with_friction_or_texture_motion_is_felt_from_the_push_on(part):
    moving, still = moving_and_still(**{part: {}})
    push = int(PUSH_S * 380)
    assert moving[:push].tobytes() == still[:push].tobytes()
    assert np.abs(moving - still)[push + 20 : push + 140].max(axis=0).min() > 1e-3


def test_a_part_that_is_named_without_values_has_its_defaults():
    named = play({'steps': SHORT, 'friction': None})
    assert named.volts.tobytes() == play({'steps': SHORT, 'friction': {}}).volts.tobytes()
    assert named.volts.tobytes() != play({'steps': SHORT}).volts.tobytes()


# What is wrong with a scene file is said in one line.


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('sample_rate_hz: 380.0', 'steps is None, allowed: a list of at least one step'),
        ('steps: []', 'steps is [], allowed: a list of at least one step'),
        ('steps: [3]', 'steps: step 1 is 3, allowed: names and values'),
        (
            'steps: [{duration_s: 1}, {duration_s: 0}]',
            'steps: step 2: parameter duration_s is 0 s, allowed: 0.001 to 3600 s',
        ),
        (
            'steps: [{duration: 1}]',
            'steps: step 1: unknown parameter duration = 1; did you mean duration_s?',
        ),
        (
            'steps: [{duration_s: 0.01, velocity_m_s: 1}]',
            'duration_s 0.01 s is too short to reach 1 m/s, allowed: at least 2 s at 0.5 m/s2',
        ),
        (
            'steps: [{}]\ntexture: {depth: 2}',
            'texture: parameter depth is 2, allowed: 0 to 1',
        ),
        (
            'steps: [{}]\nfriction: {mu: 1}',
            'friction: unknown parameter mu = 1; allowed: coefficient, shear_stiffness_n_m',
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
            'steps: [{}]\nhum: {}',
            'unknown part hum, allowed: steps, motion, contact, friction, texture, electronics',
        ),
        ('steps: [{}]\ntexture: [1]', 'texture is [1], allowed: names and values'),
        (
            'steps: [{}]\nsample_rate_hz: 0',
            'parameter sample_rate_hz is 0 Hz, allowed: 1 to 1e+06 Hz',
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


# The plate that comes with the package, under the chain that comes with it.


@pytest.mark.parametrize('seed', range(3))
def test_the_default_chain_finds_the_slip_of_the_default_plate(seed):
    samples = plate(seed)
    result = SlipChain().update(samples.volts)
    t, slip_s = times_s(samples), times_s(samples)[samples.truth]
    before = t < slip_s[0]
    assert result.channels[samples.truth].any(axis=0).all()
    assert result.groups[samples.truth].any(axis=0).all()
    assert not result.slip[before].any()
    assert not result.groups[before].any()
    # A channel alone takes the contact for slip, as the paper's do; only then, and not at rest.
    at_contact = (t > 1.0) & (t < 1.8 + 0.2)
    assert not result.channels[before & ~at_contact].any()
    delay_s = t[np.argmax(result.slip)] - slip_s[0]
    assert 0.0 < delay_s < 0.06
    assert not result.slip[t > slip_s[-1] + 0.1].any()
    assert result.slip[samples.truth].mean() > 0.95
