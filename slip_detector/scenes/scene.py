"""A scene: the parts that a YAML file names, put together and played row by row."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain import fingertip
from slip_detector.chain.samples import Samples
from slip_detector.parameters.detector import PAPER_CHANNELS
from slip_detector.parameters.files import shared_folder
from slip_detector.parameters.sets import ParameterSet, parameter, read_yaml
from slip_detector.scenes.contact import Contact
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
)
from slip_detector.scenes.drive import Drive, DriveNumbers, drive_at, normal_force_at
from slip_detector.scenes.electronics import Electronics, Frontend
from slip_detector.scenes.free_object import STANDARD_GRAVITY_M_S2, FreeObject, ObjectNumbers
from slip_detector.scenes.friction import Friction, FrictionNumbers, well_posed_or_say
from slip_detector.scenes.mechanics import STAGES, Plan, State, advance
from slip_detector.scenes.motion import (
    LoadNumbers,
    Motion,
    PlateNumbers,
    Step,
    force_numbers,
    held_force,
    load_numbers,
    plate_at,
    plate_numbers,
    steps_from,
)
from slip_detector.scenes.skin import Skin, SkinNumbers
from slip_detector.scenes.texture import RidgeNumbers, Roughness, RoughNumbers, Texture

Floats = NDArray[np.float64]

#: What a scene file can name, in the order in which the parts get their random generators.
PARTS: dict[str, type[ParameterSet]] = {
    'motion': Motion,
    'contact': Contact,
    'skin': Skin,
    'friction': Friction,
    'texture': Texture,
    'roughness': Roughness,
    'object': FreeObject,
    'electronics': Electronics,
    'hum': Hum,
    'tremor': Tremor,
    'taps': Taps,
    'rolling': Rolling,
    'faults': Faults,
    'drops': Drops,
    'clock': Clock,
}

OF_THE_SCENE = ('steps', 'sample_rate_hz', 'step_s')

#: A step is cut finer where the skin would ring faster: it takes so little of a radian.
RINGING_RAD = 0.4

#: More steps than this for a second of scene are not to be waited for.
MOST_STEPS_HZ = 2e6

#: A tremor's peak over its RMS, for what it may add to the largest normal force.
TREMOR_PEAK = 4.0

NO_FRICTION = FrictionNumbers(0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0)
NO_RIDGES = RidgeNumbers(0.0, 0.0, np.zeros(0))
NO_ROUGHNESS = RoughNumbers(0.0, np.zeros(0), np.zeros(0))
NO_OBJECT = ObjectNumbers(0.0, 0.0, 1.0)


@dataclasses.dataclass(frozen=True)
class Sampling(ParameterSet):
    """What a scene file says of itself."""

    sample_rate_hz: float = parameter(380.0, 'Rate of the samples.', unit='Hz', low=1.0, high=1e6)
    step_s: float = parameter(
        3.5e-4,
        'Longest step of the integrator; a sample period is cut into equal ones.',
        unit='s',
        low=1e-7,
        high=1.0,
    )


class Scene:
    """A fingertip and what is done to it; a :class:`~slip_detector.sources.source.Source`.

    Parts that are not named are not built: without ``friction`` the skin is not sheared, without
    ``texture`` and ``roughness`` the surface is smooth, without ``object`` the plate moves as the
    steps say. Only contact, motion and electronics are always there, with their defaults.

    Parameters
    ----------
    description
        As the scene file has it: ``steps``, ``sample_rate_hz``, ``step_s`` and the parts.
    trial
        Generator of all that differs from trial to trial: noise, phases, losses. Each part draws
        from a child of its own, so leaving one out changes nothing for the others.

    Attributes
    ----------
    sample_rate_hz : float
        As the sensor says; see the part ``clock``.
    length : int
        Number of samples, those that ``drops`` loses included.
    true_rate_hz : float
        At which the samples are taken.
    duration_s : float
        Of all steps.
    parts : dict
        The parts that are named, by their names.
    motion, contact, electronics
        The parts that are always there, with their defaults where they are not named.
    drive_numbers
        What is done to the fingertip, see :mod:`slip_detector.scenes.drive`.
    plan, state
        What the stepper works on, see :mod:`slip_detector.scenes.mechanics`.

    Raises
    ------
    ValueError
        For an unknown part, a value that is not allowed or parts that do not go together; names
        the part and the parameter.
    """

    def __init__(self, description: Mapping[str, Any], trial: np.random.Generator) -> None:
        self.parts = parts_of(description)
        own = {name: description[name] for name in ('sample_rate_hz', 'step_s')
               if name in description}  # fmt: skip
        sampling = Sampling.from_parameters(own)
        steps = steps_from(description.get('steps'))
        children = dict(zip(PARTS, trial.spawn(len(PARTS)), strict=True))
        self.channel_names = tuple(f'ch{i + 1}' for i in range(PAPER_CHANNELS))
        self.sample_rate_hz = sampling.sample_rate_hz
        clock: Clock | None = self.parts.get('clock')
        self.true_rate_hz = self.sample_rate_hz * (clock.rate_ratio if clock else 1.0)
        self.duration_s = sum(step.duration_s for step in steps)
        self.length = round(self.duration_s * self.true_rate_hz)
        if not self.length:
            raise ValueError(
                f'steps: all take {self.duration_s:g} s, allowed: at least one sample at '
                f'{self.true_rate_hz:g} Hz'
            )
        self.motion: Motion = self.parts.get('motion', Motion())
        self.contact: Contact = self.parts.get('contact', Contact())
        self.electronics: Electronics = self.parts.get('electronics', Electronics())
        self._object: FreeObject | None = self.parts.get('object')
        self._frontend = Frontend(self.electronics, children['electronics'])
        self.drive_numbers = self._drive_numbers(steps, children['tremor'])
        self._build_disturbances(children)
        self._check(steps)
        self.plan = self._plan(sampling, children['texture'])
        n_patches, n_channels = len(self.plan.patches), PAPER_CHANNELS
        self.state = State(
            np.zeros((n_patches, 4)), np.zeros(3), np.zeros(n_channels), np.zeros((n_channels, 3))
        )
        self._next = 0
        # Compiling must not wait for the first sample.
        advance(self.drive(np.zeros((0, 2))), self.state, self.plan, False, np.zeros((0, 16)),
                np.zeros(0), np.zeros(0), np.zeros(0))  # fmt: skip
        self._truth(np.zeros(0), np.zeros(0))

    def _drive_numbers(self, steps: list[Step], of_tremor: np.random.Generator) -> DriveNumbers:
        """Collect what is done to the fingertip; parts that are not named stay left out."""
        numbers = DriveNumbers(
            force_numbers(self.motion, steps),
            np.array(plate_numbers(self.motion, steps)),
            *self.contact.centre_m,
        )
        taps: Taps | None = self.parts.get('taps')
        if taps:
            numbers = numbers._replace(taps=taps.numbers())
        rolling: Rolling | None = self.parts.get('rolling')
        if rolling:
            numbers = numbers._replace(rolling=np.array(rolling.numbers()))
        if self._object:
            load = load_numbers(self._object.mass_kg * STANDARD_GRAVITY_M_S2, steps)
            numbers = numbers._replace(load=np.array(load))
        tremor: Tremor | None = self.parts.get('tremor')
        if tremor:
            hand = HandMotion(tremor, of_tremor)
            lines = hand.motion_lines
            numbers = numbers._replace(
                force_lines=np.array(hand.force_lines),
                force_lines_from_n=TREMOR_PEAK * tremor.force_rms_n,
                motion_lines=np.array(lines),
            )
            if self._object:
                # In the frame of a hand that trembles the object's mass pulls the other way.
                inertia_n = self._object.mass_kg * lines.amplitude * lines.angular_rate_rad_s**2
                numbers = numbers._replace(
                    load_lines=np.array(lines._replace(amplitude=inertia_n))
                )
        return numbers

    def _build_disturbances(self, children: dict[str, np.random.Generator]) -> None:
        parts = self.parts
        self._hum = HumVoltage(parts['hum'], children['hum']) if 'hum' in parts else None
        self._faults = None
        if 'faults' in parts:
            self._faults = FaultyChannels(
                parts['faults'], children['faults'], self.electronics.rails_v[0]
            )
        self._link = LossyLink(parts['drops'], children['drops']) if 'drops' in parts else None

    def _check(self, steps: list[Step]) -> None:
        """Refuse parts that do not go together."""
        electronics = self.electronics
        friction: Friction | None = self.parts.get('friction')
        texture: Texture | None = self.parts.get('texture')
        if self._object:
            if not friction:
                raise ValueError('object: falls without friction, allowed: with the part friction')
            if self.largest_velocity_m_s:
                raise ValueError(
                    'steps: velocity_m_s is not 0, allowed: 0 with an object, which moves by '
                    'itself'
                )
            if texture and not electronics.bandwidth_hz:
                raise ValueError(
                    'electronics: bandwidth_hz is 0, allowed: above 0 with an object and texture, '
                    'as ridges may pass faster than samples can tell'
                )
        elif any(step.carried >= 0.0 or step.pull_n for step in steps):
            raise ValueError(
                'steps: carried and pull_n are for an object, allowed: with that part'
            )
        if texture and not self._object and not electronics.bandwidth_hz:
            highest_hz = self.largest_velocity_m_s * texture.highest_wavenumber_1_m
            if highest_hz > self.true_rate_hz / 2:
                raise ValueError(
                    f'texture: passes at up to {highest_hz:.4g} Hz, which {self.true_rate_hz:g} '
                    'Hz of samples cannot tell from slower; allowed: with bandwidth_hz of the '
                    'part electronics, or below half the sample rate'
                )
        if friction:
            skin: Skin = self.parts.get('skin', Skin())
            load_n = self.contact.largest_load_n(self._largest_force_n(steps))
            well_posed_or_say(friction, skin.numbers(), load_n)

    @property
    def largest_velocity_m_s(self) -> float:
        """Return how fast the plate moves at most, in either direction; 0 where it stands."""
        return float(np.abs(PlateNumbers(*self.drive_numbers.plate).velocity_m_s).max())

    def _largest_force_n(self, steps: list[Step]) -> float:
        """Return the largest normal force that the steps and the disturbances can bring about."""
        ratio = self.motion.ringing_damping
        overshoot = math.exp(-math.pi * ratio / math.sqrt(1 - ratio**2)) if ratio < 1.0 else 0.0
        most_n = (1.0 + overshoot) * max(step.force_n for step in steps)
        if 'taps' in self.parts:
            most_n += max(self.parts['taps'].peak_force_n, 0.0)
        if 'tremor' in self.parts:
            most_n += TREMOR_PEAK * float(self.parts['tremor'].force_rms_n)
        return max(most_n, 0.0)

    def _plan(self, sampling: Sampling, of_trial: np.random.Generator) -> Plan:
        friction: Friction | None = self.parts.get('friction')
        texture: Texture | None = self.parts.get('texture')
        roughness: Roughness | None = self.parts.get('roughness')
        skin: Skin = self.parts.get('skin', Skin())
        # Without skin and filter nothing lies between two samples.
        per_sample = 1
        if friction or self.electronics.bandwidth_hz:
            step_s = min(sampling.step_s, self._ringing_step_s(skin) if friction else math.inf)
            per_sample = math.ceil(1.0 / (self.true_rate_hz * step_s) - 1e-9)
        if per_sample * self.true_rate_hz > MOST_STEPS_HZ:
            raise ValueError(
                f'the scene needs {per_sample * self.true_rate_hz:.3g} steps for a second, '
                f'allowed: {MOST_STEPS_HZ:g}; a longer step_s, more damping_n_s_m or mass_kg 0 '
                'help'
            )
        step_s = 1.0 / (self.true_rate_hz * per_sample)
        patches = np.ones(PAPER_CHANNELS if friction else 0)
        body = self._object.numbers() if self._object else NO_OBJECT
        if self._object:
            patches = np.append(patches, self._object.rest_patches)
        cutoff_rad_s = 2.0 * np.pi * self.electronics.bandwidth_hz
        return Plan(
            step_s=step_s,
            steps_per_sample=per_sample,
            decay=math.exp(-cutoff_rad_s * step_s) if cutoff_rad_s else -1.0,
            positions_m=fingertip.taxel_positions(),
            patches=patches,
            normal_v_n=self._frontend.normal_v_n,
            shear_v_n=self._frontend.shear_v_n,
            hertz=self.contact.numbers(),
            skin=skin.numbers() if friction else SkinNumbers(0.0, 0.0, 0.0),
            friction=friction.numbers() if friction else NO_FRICTION,
            ridges=texture.numbers(of_trial) if texture else NO_RIDGES,
            rough=roughness.numbers() if roughness else NO_ROUGHNESS,
            body=body,
        )

    @staticmethod
    def _ringing_step_s(skin: Skin) -> float:
        """Return the longest step that follows the skin's own ringing; it need not ring."""
        if skin.damping_n_s_m**2 >= 4.0 * skin.shear_stiffness_n_m * skin.mass_kg:
            return math.inf
        return RINGING_RAD * math.sqrt(skin.mass_kg / skin.shear_stiffness_n_m)

    def hold_force(self, force_n: float) -> None:
        """Command a normal force from the next sample on, in place of what the steps say.

        It is how a grip is controlled from outside while the scene runs; the force follows the
        command as the part ``motion`` says.

        Raises
        ------
        ValueError
            When the force is not from 0 to 1000 N, or so large that the skin would chatter.
        """
        if not 0.0 <= force_n <= 1000.0:
            raise ValueError(f'force_n is {force_n:g} N, allowed: 0 to 1000 N')
        friction: Friction | None = self.parts.get('friction')
        if friction:
            skin: Skin = self.parts.get('skin', Skin())
            load_n = self.contact.largest_load_n(2.0 * force_n)
            well_posed_or_say(friction, skin.numbers(), load_n, f'a grip of {force_n:g} N')
        held = held_force(self.drive_numbers.force, self._next / self.true_rate_hz, force_n)
        self.drive_numbers = self.drive_numbers._replace(force=held)

    def force_n(self, time_s: Floats) -> Floats:
        """Return the normal force at any times, disturbances included."""
        return np.asarray(normal_force_at(time_s, time_s, self.drive_numbers), dtype=np.float64)

    def drive(self, time_s: Floats) -> Drive:
        """Return what is done to the fingertip at given instants.

        Parameters
        ----------
        time_s : ndarray, shape (n, 2)
            Of the two stages of each step.
        """
        flat_s = time_s.ravel()
        done = drive_at(flat_s, flat_s, self.drive_numbers)
        return Drive(*(part.reshape(time_s.shape) for part in done))

    def corners_s(self) -> Floats:
        """Return the times at which what is done to the fingertip has a corner, rising."""
        numbers, taps = self.drive_numbers, self.drive_numbers.taps
        corners = [numbers.force.starts_s, PlateNumbers(*numbers.plate).starts_s]
        corners.append(LoadNumbers(*numbers.load).corners_s)
        corners += [taps.begins_s, taps.begins_s + taps.duration_s]
        if 'rolling' in self.parts:
            corners.append(self.parts['rolling'].corners_s(self.duration_s))
        times_s = np.concatenate(corners)
        return np.unique(times_s[(times_s > 0.0) & (times_s < self.duration_s)])

    def clean(
        self, n: int, ledger: Floats | None = None
    ) -> tuple[Floats, Floats, Floats, NDArray[np.float64]]:
        """Advance by up to ``n`` samples and return what the fingertip feels, free of noise.

        Parameters
        ----------
        n
            Number of samples.
        ledger : ndarray, shape (3,), optional
            To book the energies of the friction in, see
            :func:`slip_detector.scenes.mechanics.advance`.

        Returns
        -------
        time_s, clean_v, position_m, sliding
            Shapes (m,), (m, 16), (m,), (m,); m is less than ``n`` at the end. Volts less the
            baselines; position of the surface; share of the load under which it slides.
        """
        first = self._next
        last = min(first + n, self.length)
        self._next = max(last, first)
        m = self._next - first
        plan = self.plan
        clean_v, position_m, sliding = (
            np.empty((m, PAPER_CHANNELS)),
            np.empty(m),
            np.empty(m),
        )
        begin = first == 0
        # Steps are numbered from the start, so that a cut between two calls changes no bit.
        of_steps = np.arange(
            max(first - 1, 0) * plan.steps_per_sample, max(last - 1, 0) * plan.steps_per_sample
        )
        stages_s = (of_steps[:, np.newaxis] + np.array(STAGES)) * plan.step_s
        if begin and m:
            stages_s = np.concatenate([np.zeros((1, 2)), stages_s])
        advance(
            self.drive(stages_s), self.state, plan, begin, clean_v, position_m, sliding,
            np.zeros(0) if ledger is None else ledger,
        )  # fmt: skip
        time_s = np.arange(first, self._next) / self.true_rate_hz
        return time_s, clean_v, position_m, sliding

    def read(self, n: int) -> Samples:
        """Return the next ``n`` samples, fewer where some are lost, none only at the end."""
        while True:
            time_s, clean_v, position_m, sliding = self.clean(n)
            if not len(time_s):
                break
            volts = self._digitised(clean_v, time_s)
            truth = self._truth(time_s, sliding)
            if not self._object:
                # Where the platform is, without the tremor of the hand.
                position_m = plate_at(time_s, time_s, self.drive_numbers.plate)[1]
            kept = self._link.kept(len(time_s)) if self._link else slice(None)
            samples = Samples(volts[kept], truth[kept], position_m[kept], time_s[kept])
            if len(samples.volts):
                return samples
        nothing = np.zeros(0)
        return Samples(np.zeros((0, PAPER_CHANNELS)), nothing > 0.0, nothing, nothing)

    def _truth(self, time_s: Floats, sliding: Floats) -> NDArray[np.bool_]:
        """Return whether there is slip."""
        if self._object:
            # An object slips when most of what holds it slides.
            return sliding > 0.5
        # The paper's Eq. 9: slip is what the platform's position says.
        velocity_m_s, _ = plate_at(time_s, time_s, self.drive_numbers.plate)
        return np.asarray((velocity_m_s != 0.0) & (self.force_n(time_s) > 0.0))

    def _digitised(self, clean_v: Floats, time_s: Floats) -> Floats:
        """Turn what the fingertip feels into what its electronics say."""
        volts = clean_v + self._frontend.baseline_v
        if self._hum:
            volts += self._hum.volts(time_s)[:, np.newaxis]
        if self._faults:
            volts = self._faults.before_converter(volts, time_s)
        volts = self._frontend.sample(volts, 1.0 / self.true_rate_hz)
        if self._faults:
            volts = self._faults.after_converter(volts, time_s)
        return volts


def parts_of(description: Mapping[str, Any]) -> dict[str, Any]:
    """Read the parts that a description names.

    ``friction: none`` names none, ``friction: coulomb`` one with the defaults of that model.

    Raises
    ------
    ValueError
        For an unknown part or a value that is not allowed; names the part and the parameter.
    """
    parts: dict[str, Any] = {}
    for name, content in description.items():
        if name in OF_THE_SCENE:
            continue
        if name not in PARTS:
            raise ValueError(f'unknown part {name}, allowed: {", ".join((*OF_THE_SCENE, *PARTS))}')
        if name == 'friction' and content == 'none':
            continue
        values = {'model': content} if name == 'friction' and isinstance(content, str) else content
        if not isinstance(values, Mapping | None):
            raise ValueError(f'{name} is {values!r}, allowed: names and values')
        parts[name] = PARTS[name].from_parameters(values or {}, name)
    return parts


def load_scene(path: str | Path, trial: np.random.Generator) -> Scene:
    """Build the scene of a YAML file.

    Raises
    ------
    ValueError
        When the file cannot be read or describes no scene; names the file.
    """
    try:
        return Scene(read_yaml(path), trial)
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith(str(path)) else f'{path}: {text}') from None


def find_scene(name: str) -> Path:
    """Return the path of a scene given by its name or its path.

    Raises
    ------
    ValueError
        When there is none; lists the names there are.
    """
    path = Path(name)
    if path.suffix in ('.yaml', '.yml'):
        return path
    folder = shared_folder() / 'config' / 'scenes'
    known = sorted(file.stem for file in folder.glob('*.yaml'))
    if name not in known:
        raise ValueError(f'no scene {name!r}, allowed: {", ".join(known)}, or a path to a .yaml')
    return folder / f'{name}.yaml'
