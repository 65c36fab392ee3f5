"""What disturbs a real fingertip: hum, tremor, taps, rolling, faults, lost samples, a wrong clock.

All that acts over time is a closed form of the time, so that an integrator may ask for it at any
instant. What is random draws from the Generator it is given and from no other, in an order that
does not depend on how the rows are cut into calls.
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.parameters.detector import PAPER_CHANNELS
from slip_detector.parameters.sets import ParameterSet, parameter

Floats = NDArray[np.float64]

#: Tremor has one pair of lines in each of so many parts of its band ...
TREMOR_PAIRS = 3
#: ... whose second line has this amplitude relative to the first: the pair beats by so much.
TREMOR_BEAT = 0.5


class Lines(NamedTuple):
    """A sum of sines: ``amplitude * sin(angular_rate_rad_s * t + phase_rad)`` of each line.

    Attributes
    ----------
    amplitude, angular_rate_rad_s, phase_rad : ndarray, shape (k,)
    """

    amplitude: Floats
    angular_rate_rad_s: Floats
    phase_rad: Floats


NO_LINES = Lines(np.zeros(0), np.zeros(0), np.zeros(0))


@compiled
def lines_at(t, lines):
    """Return the sum of the lines at one instant or at many, in the amplitudes' unit.

    Parameters
    ----------
    t : float or ndarray, shape (n,)
        The instants.
    lines : Lines or ndarray, shape (3, k)
        Its fields or, which is less for a call to take apart, rows in their order.
    """
    amplitude, rate_rad_s, phase_rad = lines[0], lines[1], lines[2]
    total = 0.0 * t
    for k in range(amplitude.size):
        total = total + amplitude[k] * np.sin(rate_rad_s[k] * t + phase_rad[k])
    return total


@compiled
def lines_rate_at(t, lines):
    """Return the exact derivative of :func:`lines_at`, per second."""
    amplitude, rate_rad_s, phase_rad = lines[0], lines[1], lines[2]
    total = 0.0 * t
    for k in range(amplitude.size):
        rate = rate_rad_s[k]
        total = total + amplitude[k] * rate * np.cos(rate * t + phase_rad[k])
    return total


@dataclasses.dataclass(frozen=True)
class Hum(ParameterSet):
    """Mains hum, the same on all channels."""

    frequency_hz: float = parameter(50.0, 'Frequency of the mains.', unit='Hz', low=1.0, high=1e3)
    amplitude_v: float = parameter(
        5e-3, 'Amplitude (peak) of the fundamental.', unit='V', low=0.0, high=100.0
    )
    harmonics: tuple[float, ...] = parameter(
        (), 'Amplitudes of the 2nd, 3rd, ... harmonic, relative to it.', low=0.0, high=10.0
    )


class HumVoltage:
    """The hum of one trial.

    Parameters
    ----------
    hum
        Its properties.
    trial
        Generator of the phases: of the fundamental first, then of each harmonic.

    Attributes
    ----------
    lines : Lines
        Volts; the fundamental and the harmonics that are not zero.
    """

    def __init__(self, hum: Hum, trial: np.random.Generator) -> None:
        amplitude_v: Floats = hum.amplitude_v * np.array([1.0, *hum.harmonics])
        multiple: Floats = np.arange(1.0, len(amplitude_v) + 1)
        rate_rad_s = 2 * np.pi * hum.frequency_hz * multiple
        phase_rad = trial.uniform(0.0, 2 * np.pi, len(amplitude_v))
        there = amplitude_v > 0.0
        self.lines = Lines(amplitude_v[there], rate_rad_s[there], phase_rad[there])

    def volts(self, time_s: Floats) -> Floats:
        """Return what is added to every channel at each time, shape (n,)."""
        return np.asarray(lines_at(time_s, self.lines), dtype=np.float64)


@dataclasses.dataclass(frozen=True)
class Tremor(ParameterSet):
    """Tremor of the hand and motion of the arm.

    The default force is about the tremor of healthy fingers in a pinch (the power that Table 1 of
    https://www.hindawi.com/journals/cmmm/2012/975735/ calls background is up to 50 mN^2, 7 mN).
    The default motion is small, so that the skin takes it up and nothing slides.
    """

    low_hz: float = parameter(2.0, 'Lowest frequency.', unit='Hz', low=0.01, high=1e3)
    high_hz: float = parameter(20.0, 'Highest frequency.', unit='Hz', low=0.01, high=1e3)
    force_rms_n: float = parameter(
        0.01, 'RMS of what is added to the normal force.', unit='N', low=0.0, high=100.0
    )
    motion_rms_m: float = parameter(
        5e-6, 'RMS of the motion of the surface along x.', unit='m', low=0.0, high=0.1
    )

    def __post_init__(self) -> None:
        """Check that there is a band."""
        super().__post_init__()
        if self.low_hz >= self.high_hz:
            raise ValueError(
                f'parameter high_hz is {self.high_hz:g} Hz, allowed: above low_hz, '
                f'{self.low_hz:g} Hz'
            )


class HandMotion:
    """The tremor of one trial: six lines for the normal force, six others for the surface's place.

    The band is cut into three parts of equal ratio; in each two neighbouring lines beat slowly.
    All lines lie within the band, and their RMS in the long run is the one asked for.

    Parameters
    ----------
    tremor
        Its properties.
    trial
        Generator of the trial. Two children are always spawned from it, for the force and for
        the motion, in this order; where the RMS is zero nothing is drawn.

    Attributes
    ----------
    force_lines, motion_lines : Lines
        Newtons and metres; without lines where the RMS is zero.
    """

    def __init__(self, tremor: Tremor, trial: np.random.Generator) -> None:
        of_force, of_motion = trial.spawn(2)
        self.force_lines = _tremor_lines(tremor, tremor.force_rms_n, of_force)
        self.motion_lines = _tremor_lines(tremor, tremor.motion_rms_m, of_motion)


def _tremor_lines(tremor: Tremor, rms: float, trial: np.random.Generator) -> Lines:
    if not rms:
        return NO_LINES
    # Places on the logarithmic scale from low_hz (0) to high_hz (1), none at the very edges.
    first = np.arange(TREMOR_PAIRS) + trial.uniform(0.05, 0.85, TREMOR_PAIRS)
    second = first + trial.uniform(0.02, 0.1, TREMOR_PAIRS)
    places = np.concatenate([first, second]) / TREMOR_PAIRS
    frequency_hz = tremor.low_hz * (tremor.high_hz / tremor.low_hz) ** places
    relative = np.repeat([1.0, TREMOR_BEAT], TREMOR_PAIRS)
    amplitude = relative * rms / np.sqrt(np.sum(np.square(relative)) / 2)
    phase_rad = trial.uniform(0.0, 2 * np.pi, len(places))
    return Lines(amplitude, 2 * np.pi * frequency_hz, phase_rad)


class TapNumbers(NamedTuple):
    """What the compiled code needs of :class:`Taps`; no begins where there are none."""

    begins_s: Floats
    peak_force_n: float
    duration_s: float


@dataclasses.dataclass(frozen=True)
class Taps(ParameterSet):
    """Taps: half sines on the normal force. The impulse of one is 2 / pi x peak x duration."""

    times_s: tuple[float, ...] = parameter(
        (),
        'When each begins.',
        unit='s',
        low=0.0,
        high=1e6,
        allows='at least one, rising, at least duration_s apart, 0 to 1e+06 s',
    )
    peak_force_n: float = parameter(
        0.5, 'Peak; negative: it relieves the contact.', unit='N', low=-1000.0, high=1000.0
    )
    duration_s: float = parameter(0.01, 'How long one takes.', unit='s', low=1e-4, high=10.0)

    def __post_init__(self) -> None:
        """Check that there are taps, one after the other."""
        super().__post_init__()
        if not self.times_s:
            raise ValueError('parameter times_s is empty, allowed: at least one time')
        for before, after in zip(self.times_s[:-1], self.times_s[1:], strict=True):
            # One that begins where the one before ends may lie a round-off too early.
            if after - before < self.duration_s * (1 - 1e-9):
                raise ValueError(
                    f'parameter times_s has {after:g} s after {before:g} s, allowed: rising, at '
                    f'least duration_s, {self.duration_s:g} s, apart'
                )

    def numbers(self) -> TapNumbers:
        """Return what the compiled code needs."""
        return TapNumbers(np.array(self.times_s), self.peak_force_n, self.duration_s)


@compiled
def tap_force_at(t, side, numbers):
    """Return what taps add to the normal force; exactly zero between them.

    Parameters
    ----------
    t : float or ndarray, shape (n,)
        The instants.
    side : as ``t``
        Says at either end of a tap which side is meant.
    numbers : TapNumbers
        Of at least one tap.
    """
    # Before the first tap the index is -1, and the time since the last tap is negative.
    begin = numbers.begins_s[np.searchsorted(numbers.begins_s, side, side='right') - 1]
    during = (side >= begin) & (side - begin < numbers.duration_s)
    force = numbers.peak_force_n * np.sin(np.pi / numbers.duration_s * (t - begin))
    return np.where(during, force, 0.0)


class RollingNumbers(NamedTuple):
    """What the compiled code needs of :class:`Rolling`."""

    start_s: float
    duration_s: float
    hold_s: float
    lasts_s: float
    x_m: float
    y_m: float


@dataclasses.dataclass(frozen=True)
class Rolling(ParameterSet):
    """The object rolls over the fingertip and back: the contact moves, and nothing slides."""

    start_s: float = parameter(1.0, 'When it begins.', unit='s', low=0.0, high=1e6)
    duration_s: float = parameter(
        0.5, 'How long it takes to roll one way.', unit='s', low=1e-3, high=3600.0
    )
    hold_s: float = parameter(
        0.0, 'How long it rests at either end.', unit='s', low=0.0, high=3600.0
    )
    distance_m: tuple[float, float] = parameter(
        (1.5e-3, 0.0), 'How far the centre of contact moves: x, y.', unit='m', low=-0.1, high=0.1
    )
    repeats: int = parameter(1, 'How often it rolls there and back.', low=1, high=10**6)

    @property
    def cycle_s(self) -> float:
        """How long it takes to roll there, to rest, to roll back and to rest."""
        return 2.0 * (self.duration_s + self.hold_s)

    def numbers(self) -> RollingNumbers:
        """Return what the compiled code needs."""
        return RollingNumbers(
            self.start_s, self.duration_s, self.hold_s, self.repeats * self.cycle_s,
            *self.distance_m,
        )  # fmt: skip

    def corners_s(self, until_s: float) -> Floats:
        """Return when it begins and ends to move, in the cycles that begin before ``until_s``."""
        cycles = min(self.repeats, max(math.ceil((until_s - self.start_s) / self.cycle_s), 0))
        back_s = 0.5 * self.cycle_s
        within_s = [0.0, self.duration_s, back_s, back_s + self.duration_s]
        begins_s = self.start_s + self.cycle_s * np.arange(cycles)
        return np.asarray(np.add.outer(begins_s, within_s).ravel())


@compiled
def _smooth_step(u):
    """Return ``3 u^2 - 2 u^3`` between 0 and 1: its slope is zero at both ends."""
    u = np.minimum(np.maximum(u, 0.0), 1.0)
    return u * u * (3.0 - 2.0 * u)


@compiled
def rolled_at(t, numbers):
    """Return how far the centre of contact is from where it is at rest: x and y.

    It moves along a smooth step, so its velocity is zero at both ends and has no jump. It is
    exactly zero before the start and after the last way back. ``numbers`` are RollingNumbers or
    one array with the fields in their order.
    """
    start_s, duration_s, hold_s, lasts_s = numbers[0], numbers[1], numbers[2], numbers[3]
    one_way = duration_s + hold_s
    since = np.minimum(np.maximum(t - start_s, 0.0), lasts_s)
    within = since - 2.0 * one_way * np.floor(since / (2.0 * one_way))
    share = _smooth_step(within / duration_s) - _smooth_step((within - one_way) / duration_s)
    return share * numbers[4], share * numbers[5]


@dataclasses.dataclass(frozen=True)
class Faults(ParameterSet):
    """Channels that fail."""

    from_s: float = parameter(0.0, 'When they fail.', unit='s', low=0.0, high=1e6)
    dead_channels: tuple[int, ...] = parameter(
        (), 'Channels that read the lowest voltage there is.', low=1, high=PAPER_CHANNELS
    )
    flat_channels: tuple[int, ...] = parameter(
        (),
        'Channels that go on reading the first sample of that time.',
        low=1,
        high=PAPER_CHANNELS,
    )
    noisy_channels: tuple[int, ...] = parameter(
        (), 'Channels with more noise.', low=1, high=PAPER_CHANNELS
    )
    noise_v: float = parameter(
        0.05, 'Standard deviation of the noise they have more.', unit='V', low=0.0, high=100.0
    )

    def __post_init__(self) -> None:
        """Check that some channel fails, and each in one way only."""
        super().__post_init__()
        failing: set[int] = set()
        for name in ('dead_channels', 'flat_channels', 'noisy_channels'):
            for channel in getattr(self, name):
                if channel in failing:
                    raise ValueError(
                        f'parameter {name} has channel {channel}, which fails already, '
                        'allowed: one fault for a channel'
                    )
                failing.add(channel)
        if not failing:
            raise ValueError(
                'parameters dead_channels, flat_channels and noisy_channels are all empty, '
                'allowed: at least one channel'
            )


class FaultyChannels:
    """The faults of one trial, in two places of the electronics.

    A bad joint adds its noise to the analog voltage, which rails and converter then limit and
    quantise like any other: :meth:`before_converter`. A dead or a flat channel repeats one code
    without the least noise, which no analog voltage does: :meth:`after_converter`.

    Parameters
    ----------
    faults
        Which channels fail, how and when.
    trial
        Generator of the noise.
    lowest_v
        What a dead channel reads: the lower rail.
    """

    def __init__(self, faults: Faults, trial: np.random.Generator, lowest_v: float) -> None:
        self._faults, self._noise, self._lowest_v = faults, trial, lowest_v
        self._dead = np.array(faults.dead_channels, dtype=int) - 1
        self._flat = np.array(faults.flat_channels, dtype=int) - 1
        self._noisy = np.array(faults.noisy_channels, dtype=int) - 1
        self._held_v: Floats | None = None

    def before_converter(self, clean_v: Floats, time_s: Floats) -> Floats:
        """Add the noise of the noisy channels; call it with consecutive rows.

        Parameters
        ----------
        clean_v : ndarray, shape (n, 16)
            What the channels would read.
        time_s : ndarray, shape (n,)
            When each row is sampled.

        Returns
        -------
        ndarray, shape (n, 16)
            A new array, or ``clean_v`` itself where nothing is added.
        """
        if not len(self._noisy) or not self._faults.noise_v:
            return clean_v
        failed = time_s >= self._faults.from_s
        noise = self._noise.standard_normal((np.count_nonzero(failed), len(self._noisy)))
        volts: Floats = clean_v.copy()
        volts[np.ix_(failed, self._noisy)] += self._faults.noise_v * noise
        return volts

    def after_converter(self, volts: Floats, time_s: Floats) -> Floats:
        """Overwrite the dead and the flat channels; call it with consecutive rows.

        Parameters
        ----------
        volts : ndarray, shape (n, 16)
            Samples as the converter gives them.
        time_s : ndarray, shape (n,)
            When each row was sampled.

        Returns
        -------
        ndarray, shape (n, 16)
            A new array, or ``volts`` itself where nothing changes.
        """
        failed = time_s >= self._faults.from_s
        if not (len(self._dead) or len(self._flat)) or not np.any(failed):
            return volts
        if self._held_v is None:
            self._held_v = volts[np.argmax(failed), self._flat]
        result: Floats = volts.copy()
        result[np.ix_(failed, self._dead)] = self._lowest_v
        result[np.ix_(failed, self._flat)] = self._held_v
        return result


@dataclasses.dataclass(frozen=True)
class Drops(ParameterSet):
    """Samples that are lost on the way, one at a time or several in a row."""

    share: float = parameter(0.01, 'Share of the samples that are lost.', low=0.0, high=0.99)
    burst_samples: float = parameter(
        1.0, 'Mean number lost in a row; 1: never two.', low=1.0, high=1e6
    )

    def __post_init__(self) -> None:
        """Check that bursts of this length can make up the share."""
        super().__post_init__()
        most = self.burst_samples / (self.burst_samples + 1)
        if self.share > most:
            raise ValueError(
                f'parameter share is {self.share:g}, allowed: at most {most:g} with a '
                f'burst_samples of {self.burst_samples:g}, as one sample comes between bursts'
            )


class LossyLink:
    """The losses of one trial: a Markov chain of two states (Gilbert's model).

    Parameters
    ----------
    drops
        How many are lost.
    trial
        Generator; one number is drawn for each sample.
    """

    def __init__(self, drops: Drops, trial: np.random.Generator) -> None:
        self._trial = trial
        self._goes_on = 1.0 - 1.0 / drops.burst_samples
        # What makes the share the stationary one.
        self._begins = drops.share / ((1.0 - drops.share) * drops.burst_samples)
        self._lost = False

    def kept(self, n: int) -> NDArray[np.bool_]:
        """Say of each of the next ``n`` samples whether it arrives, shape (n,)."""
        kept = np.ones(n, dtype=np.bool_)
        if self._begins:
            for i, draw in enumerate(self._trial.random(n).tolist()):
                self._lost = draw < (self._goes_on if self._lost else self._begins)
                kept[i] = not self._lost
        return kept


@dataclasses.dataclass(frozen=True)
class Clock(ParameterSet):
    """A sensor whose clock does not run at the rate it says."""

    rate_ratio: float = parameter(
        1.01, 'True rate of the samples over the rate it says.', low=0.1, high=10.0
    )
