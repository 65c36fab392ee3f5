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

"""A scene, which makes samples of its parts; and scene files by their names."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.chain.samples import Floats, Samples
from slip_detector.parameters import (
    PAPER_CHANNELS,
    default_channel_names,
    quote,
    read_yaml,
    refuse,
    shared_folder,
)
from slip_detector.scenes import motion
from slip_detector.scenes.electronics import Frontend, taxel_positions
from slip_detector.scenes.friction import Friction
from slip_detector.scenes.mechanics import STAGE_TIMES, SceneConstants, State, advance
from slip_detector.scenes.parts import Sampling, check_grip, check_parts, read_parts, spawn_parts
from slip_detector.scenes.surface import FreeObject, RidgeNumbers, RoughNumbers


class Scene:
    """A simulated fingertip with the forces and motions that act on it.

    A scene has the parts that its description names. Without ``friction`` the skin is not sheared,
    without ``texture`` and ``roughness`` the surface is smooth, and without ``object`` a plate
    moves as the steps say. Contact, motion, skin and electronics are always there.

    Parameters
    ----------
    description
        The content of a scene file: ``steps``, ``sample_rate_hz``, ``step_s`` and the parts.
    trial
        Generator of everything that differs from trial to trial: noise and phases. Each part
        draws from a child generator of its own, so that no part changes the draws of another.

    Attributes
    ----------
    sample_rate_hz : float
    channel_names : tuple of str
    length : int
        Number of samples.
    duration_s : float
        Duration of all steps.
    parts : dict
        All parts, by their names.
    drive_numbers : DriveNumbers
        The forces and motions that act on the fingertip.
    constants : SceneConstants
    state : State
        The arguments of :func:`slip_detector.scenes.mechanics.advance`.

    Raises
    ------
    ValueError
        For an unknown part, a value that is not allowed or parts that contradict each other; names
        the part and the parameter.

    Examples
    --------
    >>> press_and_slide = [{'force_n': 0.4}, {'duration_s': 0.5, 'velocity_m_s': 6.7e-3}]
    >>> scene = Scene({'steps': press_and_slide, 'friction': {}}, np.random.default_rng(0))
    >>> samples = scene.read(1000)
    >>> samples.volts.shape  # 1.5 s at 380 Hz
    (570, 16)
    >>> int(samples.stamps_ns[samples.truth][0])
    1002631579
    """

    def __init__(self, description: Mapping[str, Any], trial: np.random.Generator) -> None:
        self.parts = parts = read_parts(description)
        names = description.keys() & Sampling.__dataclass_fields__
        sampling = Sampling.from_parameters({name: description[name] for name in names})
        steps = motion.read_steps(description.get('steps'))
        children = spawn_parts(trial)
        self.channel_names = default_channel_names(PAPER_CHANNELS)
        self.sample_rate_hz = sampling.sample_rate_hz
        self.duration_s = sum(step.duration_s for step in steps)
        self.length = round(self.duration_s * self.sample_rate_hz)
        if not self.length:
            refuse(f'steps: all take {self.duration_s:g} s', 'at least one sample')
        self.drive_numbers = motion.drive_numbers(parts, steps, children['tremor'])
        check_parts(parts, steps, self.sample_rate_hz)
        self._frontend = Frontend(parts, children, self.sample_rate_hz)
        self.constants = self._scene_constants(sampling.step_s, children['texture'])
        shapes = (len(self.constants.patches), 4), 3, PAPER_CHANNELS, (PAPER_CHANNELS, 3)
        self.state = State(*(np.zeros(shape) for shape in shapes))
        self._next = 0
        # The steps of the last order; each is appended when the step before has ended.
        self._steps_to_come: Iterator[motion.Step] = iter(())
        # Compile the functions now, so that the first read or order does not wait for it.
        self.read(0)
        motion.plate_at(0.0, self.drive_numbers.plate)

    def _scene_constants(
        self, longest_step_s: float, ridge_trial: np.random.Generator
    ) -> SceneConstants:
        """Return the inputs of the integrator that do not change while the scene runs."""
        parts, frontend, rate_hz = self.parts, self._frontend, self.sample_rate_hz
        friction: Friction | None = parts.get('friction')
        body: FreeObject | None = parts.get('object')
        bandwidth_hz = parts['electronics'].bandwidth_hz
        steps_per_sample = 1
        # Without friction and low-pass filter nothing changes between two samples.
        if friction or bandwidth_hz:
            steps_per_sample = math.ceil(1.0 / (rate_hz * longest_step_s) - 1e-9)
        step_s = 1.0 / (rate_hz * steps_per_sample)
        patches = np.ones(PAPER_CHANNELS if friction else 0)
        cutoff_rad_s = 2.0 * np.pi * bandwidth_hz
        return SceneConstants(
            step_s=step_s,
            steps_per_sample=steps_per_sample,
            decay=math.exp(-cutoff_rad_s * step_s) if cutoff_rad_s else -1.0,
            positions_m=taxel_positions(),
            patches=np.append(patches, body.rest_patches) if body else patches,
            normal_v_n=frontend.normal_v_n,
            shear_v_n=frontend.shear_v_n,
            contact=parts['contact'].numbers(),
            skin=parts['skin'].numbers(),
            friction=(friction or Friction()).numbers(),
            ridges=parts['texture'].ridges(ridge_trial) if 'texture' in parts else RidgeNumbers(),
            rough=parts['roughness'].profile() if 'roughness' in parts else RoughNumbers(),
            body=(body or FreeObject()).numbers(),
        )

    def hold_force(self, force_n: float) -> None:
        """Command a normal force from the next sample on, in place of the steps' force.

        The force follows the command as the part ``motion`` describes.

        Raises
        ------
        ValueError
            When the force is not from 0 to 1000 N, or so large that the skin would chatter.
        """
        if not 0.0 <= force_n <= 1000.0:
            refuse(f'force_n is {force_n:g} N', '0 to 1000 N')
        if 'friction' in self.parts:
            check_grip(self.parts, 2.0 * force_n, f'a grip of {force_n:g} N')
        now_s = self._next / self.sample_rate_hz
        held = motion.held_force(self.drive_numbers.force, now_s, force_n)
        self.drive_numbers = self.drive_numbers._replace(force=held)

    def order(self, what: str) -> None:
        """Let the fingertip rest, slip, be tapped or be pressed from the next sample on.

        The scene then lasts 11 minutes more, or until the next order.

        Raises
        ------
        ValueError
            For any other order, or when the scene has no part ``orders``.
        """
        orders: motion.Orders | None = self.parts.get('orders')
        if orders is None or what not in motion.ORDERS:
            allowed = ', '.join(motion.ORDERS) if orders else 'with that part'
            refuse(f'order is {quote(what)}', allowed)
        now_s, numbers = self._next / self.sample_rate_hz, self.drive_numbers
        self._steps_to_come = orders.steps(what)
        every_s, taps = orders.tapped_every_s, np.zeros(0)
        if what == 'taps':
            taps = now_s + np.arange(every_s, motion.ORDER_S, every_s)
        velocity_m_s = orders.velocity_m_s if what == 'slip' else 0.0
        self.length = self._next + round(motion.ORDER_S * self.sample_rate_hz)
        self.drive_numbers = numbers._replace(
            force=motion.held_force(numbers.force, now_s, float(numbers.force.command_n[-1])),
            plate=motion.with_velocity(numbers.plate, now_s, velocity_m_s, self.parts['motion']),
            taps=numbers.taps._replace(times_s=taps),
        )

    def force_n(self, time_s: Floats) -> Floats:
        """Return the normal force at given times, with disturbances."""
        return np.asarray(motion.normal_force_at(time_s, self.drive_numbers), dtype=np.float64)

    def _append_steps(self, until_s: float) -> None:
        """Append the ordered steps that begin before a time to the normal force."""
        force = self.drive_numbers.force
        while force.starts_s[-1] < until_s and (step := next(self._steps_to_come, None)):
            force = motion.with_steps(force, force.starts_s[-1], force.command_n[-1], [step])
        self.drive_numbers = self.drive_numbers._replace(force=force)

    def clean(self, n: int) -> tuple[Floats, Floats, Floats, Floats]:
        """Advance by up to ``n`` samples and return the signals of the fingertip without noise.

        Returns
        -------
        time_s, clean_v, position_m, sliding
            Times, shape (m,); volts without the baselines, shape (m, 16); position of the
            surface, shape (m,); share of the load under which the surface slides, shape (m,). At
            the end of the scene m is less than ``n``.
        """
        first = self._next
        self._next = last = min(first + n, self.length)
        m = last - first
        constants = self.constants
        self._append_steps(last / self.sample_rate_hz)
        clean_v, position_m, sliding = np.empty((m, PAPER_CHANNELS)), np.empty(m), np.empty(m)
        begin = first == 0
        # Steps are counted from the scene's start: any cut into reads gives the same bits.
        ends = (max(k - 1, 0) * constants.steps_per_sample for k in (first, last))
        steps = np.arange(*ends)[:, np.newaxis]
        stages_s = (steps + np.array(STAGE_TIMES)) * constants.step_s
        if begin and m:
            stages_s = np.concatenate([np.zeros((1, 2)), stages_s])
        flat = motion.drive_at(stages_s.ravel(), self.drive_numbers)
        drive = motion.Drive(*(values.reshape(stages_s.shape) for values in flat))
        advance(drive, self.state, constants, begin, clean_v, position_m, sliding)
        time_s = np.arange(first, last) / self.sample_rate_hz
        return time_s, clean_v, position_m, sliding

    def read(self, n: int) -> Samples:
        """Return the next ``n`` samples with their labels, stamped from the scene's begin on.

        The position is that of the object, or of the platform without the tremor of the hand. Any
        cut of a scene into reads gives the same bits. Only the end of a scene gives fewer samples.
        """
        time_s, clean_v, position_m, sliding = self.clean(n)
        force_n = self.force_n(time_s)
        volts = self._frontend.sample(clean_v, time_s, force_n)
        if 'object' in self.parts:
            # An object slips when more than half of the load that holds it slides.
            truth = sliding > 0.5
        else:
            # The paper's Eq. 9: there is slip while the position of the platform changes.
            velocity_m_s, position_m = motion.plate_at(time_s, self.drive_numbers.plate)
            truth = (velocity_m_s != 0.0) & (force_n > 0.0)
        return Samples(volts, np.rint(time_s * 1e9).astype(np.int64), truth, position_m)


def load_scene(path: str | Path, trial: np.random.Generator) -> Scene:
    """Build the scene that a YAML file describes.

    Parameters
    ----------
    path
        The file.
    trial
        Generator of everything that differs from trial to trial.

    Raises
    ------
    ValueError
        When the file cannot be read or does not describe a scene; names the file.

    Examples
    --------
    >>> scene = load_scene(find_scene('plate_400um'), np.random.default_rng(0))
    >>> samples = scene.read(380)
    >>> samples.volts.shape, bool(samples.truth.any())
    ((380, 16), False)
    """
    try:
        return Scene(read_yaml(path), trial)
    except ValueError as error:
        raise ValueError(f'{path}: {str(error).removeprefix(f"{path}: ")}') from None


def find_scene(name: str) -> Path:
    """Return the path of a scene file.

    Parameters
    ----------
    name
        Name of a scene of the package, or a path that ends in .yaml or .yml.

    Raises
    ------
    ValueError
        When the package has no scene of this name; lists the names.

    Examples
    --------
    >>> find_scene('taps').name, find_scene('my/own.yaml').name
    ('taps.yaml', 'own.yaml')
    """
    path = Path(name)
    if path.suffix in ('.yaml', '.yml'):
        return path
    folder = shared_folder() / 'config' / 'scenes'
    known = sorted(file.stem for file in folder.glob('*.yaml'))
    if name not in known:
        refuse(f'no scene {quote(name)}', f'{", ".join(known)}, or a path to a .yaml')
    return folder / f'{name}.yaml'
