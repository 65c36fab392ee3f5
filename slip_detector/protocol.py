"""The paper's protocol: three plates, ten trials on each, and its figures beside ours.

Each trial is a scene of the package, simulated once and run through several chains: the one that
is asked for, the same with other windows (as the paper's Fig. 4) and the same with wider bands
and no stop-band above them (as its Fig. 7). Trial k of each plate has the seed k, so that the
plates differ in nothing but their spatial period.

Of the paper's Table 2 the means and standard deviations of each plate are at hand, its delays of
the single trials are not; of Figs. 4 and 7 what they say, not their values. What is not at hand is
left out.

``slip_evaluate --protocol paper --json`` prints one object:

``seeds``
    Of the trials of each plate.
``scenes``
    By plate, which is named by its spatial period in micrometres (``400``, ``440``, ``480``):
    the scene.
``paper``
    What the paper reports: by plate ``mean_delay_ms`` and ``sd_delay_ms``, and
    ``false_positive_percent``.
``plates``
    By plate: ``trial_delays_ms``, the delay of each trial, which is the mean over its channels
    (Eq. 10) of the time from the last sample at which the plate still stood (Eq. 9) to the
    channel's first ON before the plate stands again; ``mean_delay_ms`` and ``sd_delay_ms`` (n - 1)
    over the trials; ``detected``, the trials whose global decision is ON while the plate moves, of
    ``trials``; ``false_positive_percent``, the share of the time at which the plate stands, of all
    trials together, that the global decision is ON; ``channels_without_on``, how many channels of
    all trials have no such ON and hence no part in the means. null where a figure is not defined.
``all``
    The same figures over the trials of all plates.
``windows``
    By length of both windows in milliseconds (``20``, ``30``, ``40``): ``plates`` and ``all``.
``bands``
    By edges of the band-pass in Hz (``10-100``, ``10-150``), without the stop-bands above the
    configured band: ``plates`` and ``all``.
``wanted``
    For each claim: the ``value`` (null where it is not defined), the ``bound`` as text and whether
    it is ``met``; see :data:`WANTED`.
``plots``
    The pictures that were written.
"""

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from slip_detector.chain import SlipChain
from slip_detector.config import ChainConfig
from slip_detector.filters import design
from slip_detector.recordings import RATE_TOLERANCE
from slip_detector.scenes.scene import load_scene
from slip_detector.scores import false_positive_percent, first_on_delay_s, mean_delay
from slip_detector.sources import Samples, Source, find_scene

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

#: The plates by their spatial period in micrometres (Section 3), and their scenes.
SCENES = {'400': 'plate_400um', '440': 'plate_440um', '480': 'plate_480um'}

#: Trials on each plate (Section 3).
TRIALS = 10

#: Table 2: mean and standard deviation of the delay over the trials of each plate.
PAPER_DELAY_MS = {'400': (36.02, 3.91), '440': (41.78, 10.78), '480': (48.90, 9.91)}

#: The paper's share of the time without slip at which its detector was ON.
PAPER_FALSE_POSITIVE_PERCENT = 1.01

#: Fig. 4: lengths of both windows; the last is the paper's choice.
WINDOWS_S = (0.02, 0.03, 0.04)

#: Fig. 7: the band-passes that go without the high stop-band.
BANDS_HZ = ((10.0, 100.0), (10.0, 150.0))

ROWS_PER_READ = 4096


class Bound(NamedTuple):
    """What is wanted of a figure: from ``low`` to ``high``, or above ``low`` where ``above``."""

    low: float = -np.inf
    high: float = np.inf
    above: bool = False

    def met(self, figure: float | None) -> bool:
        """Return whether a figure is as wanted; one that is not defined is not."""
        if figure is None:
            return False
        return (figure > self.low if self.above else figure >= self.low) and figure <= self.high

    def __str__(self) -> str:
        if self.high == np.inf:
            return f'{">" if self.above else ">="} {self.low:g}'
        return f'<= {self.high:g}' if self.low == -np.inf else f'{self.low:.2f} to {self.high:.2f}'


#: What is wanted of the figures that :func:`claims` gives under the same names.
WANTED: dict[str, Bound] = {
    'detected_percent': Bound(low=100.0),
    **{
        f'mean_delay_ms.{plate}': Bound(mean - sd, mean + sd)
        for plate, (mean, sd) in PAPER_DELAY_MS.items()
    },
    'least_rise_ms': Bound(low=0.0, above=True),
    'worst_false_positive_percent': Bound(high=PAPER_FALSE_POSITIVE_PERCENT),
    'windows.20.false_positive_percent_more': Bound(low=0.0, above=True),
    'windows.30.false_positive_percent_more': Bound(low=0.0, above=True),
    'bands.10-100.least_shortening_ms': Bound(low=0.0, above=True),
    'bands.10-150.least_shortening_ms': Bound(low=0.0, above=True),
}

#: The claims in words.
MEANINGS = {
    'detected_percent': 'trials detected [%]',
    **{
        f'mean_delay_ms.{plate}': f'mean delay, {plate} um, within the sd of the paper [ms]'
        for plate in SCENES
    },
    'least_rise_ms': 'least rise of the mean delay from plate to plate [ms]',
    'worst_false_positive_percent': 'false positives, worst plate [% of the time without slip]',
    'windows.20.false_positive_percent_more': 'false positives, windows of 20 ms less 40 ms [%]',
    'windows.30.false_positive_percent_more': 'false positives, windows of 30 ms less 40 ms [%]',
    'bands.10-100.least_shortening_ms': 'delay saved by [10, 100] Hz, least of the plates [ms]',
    'bands.10-150.least_shortening_ms': 'delay saved by [10, 150] Hz, least of the plates [ms]',
}


class Trial(NamedTuple):
    """A trial to its end.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    position_m : ndarray, shape (n,)
        Of the platform.
    sample_rate_hz : float
    start, end : int
        The last row at which the plate still stood (Eq. 9), and the first at which it stood again.
    """

    volts: Floats
    position_m: Floats
    sample_rate_hz: float
    start: int
    end: int

    @property
    def time_s(self) -> Floats:
        """When each row was taken, from 0; shape (n,)."""
        return np.arange(len(self.volts)) / self.sample_rate_hz

    @property
    def moving(self) -> Bools:
        """Whether the plate moves, from ``start`` to ``end``; shape (n,)."""
        rows = np.arange(len(self.volts))
        return np.asarray((rows >= self.start) & (rows <= self.end))

    @property
    def motion_s(self) -> tuple[float, float]:
        """Times of ``start`` and ``end``."""
        return self.start / self.sample_rate_hz, self.end / self.sample_rate_hz


def trial_of(samples: Samples, sample_rate_hz: float) -> Trial:
    """Make a trial of all its samples.

    Raises
    ------
    ValueError
        When the position of the platform is not known or never changes.
    """
    if samples.position_m is None:
        raise ValueError('the platform has no position, allowed: a source that gives it')
    moved = np.flatnonzero(np.diff(samples.position_m))
    if not moved.size:
        raise ValueError('the platform does not move, allowed: a trial in which it does')
    start, end = int(moved[0]), int(moved[-1]) + 1
    return Trial(samples.volts, samples.position_m, sample_rate_hz, start, end)


def play(source: Source) -> Trial:
    """Read a source to its end.

    Raises
    ------
    ValueError
        As :func:`trial_of`.
    """
    parts = [source.read(ROWS_PER_READ)]
    while len(parts[-1].volts) == ROWS_PER_READ:
        parts.append(source.read(ROWS_PER_READ))
    positions = [part.position_m for part in parts if part.position_m is not None]
    whole = Samples(
        np.concatenate([part.volts for part in parts]),
        position_m=np.concatenate(positions) if len(positions) == len(parts) else None,
    )
    return trial_of(whole, source.sample_rate_hz)


def simulate(scene: str, seeds: Iterable[int]) -> list[Trial]:
    """Play a scene once for each seed.

    Parameters
    ----------
    scene
        Its name or path.
    seeds
        Of the noise.

    Raises
    ------
    ValueError
        When there is no such scene, it cannot be read, or its plate does not move; names it.
    """
    path = find_scene(scene)
    sources = [load_scene(path, np.random.default_rng(seed)) for seed in seeds]
    try:
        return [play(source) for source in sources]
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from None


class Outcome(NamedTuple):
    """What a chain made of a trial.

    Attributes
    ----------
    delays_s : tuple of float or None
        By enabled channel: from the start of the plate to the first ON while it moves.
    on : ndarray of bool, shape (n,)
        The global decision.
    moving : ndarray of bool, shape (n,)
        Whether the plate moves.
    """

    delays_s: tuple[float | None, ...]
    on: Bools
    moving: Bools


def outcome(trial: Trial, chain: SlipChain) -> Outcome:
    """Run a trial through a chain from its first row.

    An ON that comes when the plate stands again is none of the motion: such a channel has no
    delay.

    Raises
    ------
    ValueError
        When the trial does not suit the chain.
    """
    config = chain.config
    rate, wanted = trial.sample_rate_hz, config.sample_rate_hz
    if abs(rate - wanted) > RATE_TOLERANCE * wanted:
        raise ValueError(
            f'the trial has {rate:g} Hz where the parameter sample_rate_hz is {wanted:g} Hz, '
            f'allowed: at most {RATE_TOLERANCE:.0%} apart'
        )
    if trial.volts.shape[1] != config.channels:
        raise ValueError(
            f'the trial has {trial.volts.shape[1]} channels, allowed: {config.channels}, the '
            'parameter channels'
        )
    chain.reset()
    result = chain.update(trial.volts, envelope=False, level=False)
    moving, time_s = trial.moving, trial.time_s
    delays_s = tuple(
        first_on_delay_s(result.channels[:, c] & moving, time_s, trial.motion_s[0])
        for c in range(config.channels)
        if c + 1 not in config.disabled_channels
    )
    return Outcome(delays_s, result.slip, moving)


def figures(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return the figures of merit of trials; the keys are in the module's docstring.

    Parameters
    ----------
    outcomes
        At least one.
    """
    delays_ms = [_in_ms(mean_delay(one.delays_s)[0]) for one in outcomes]
    mean_ms, sd_ms = mean_delay(delays_ms)
    return {
        'mean_delay_ms': mean_ms,
        'sd_delay_ms': sd_ms,
        'trial_delays_ms': delays_ms,
        'detected': sum(bool((one.on & one.moving).any()) for one in outcomes),
        'trials': len(outcomes),
        'false_positive_percent': false_positive_percent(
            np.concatenate([one.on for one in outcomes]),
            np.concatenate([one.moving for one in outcomes]),
        ),
        'channels_without_on': sum(one.delays_s.count(None) for one in outcomes),
    }


def _in_ms(seconds: float | None) -> float | None:
    return None if seconds is None else seconds * 1e3


def evaluate_plates(
    plates: Mapping[str, Sequence[Trial]], config: ChainConfig
) -> dict[str, dict[str, Any]]:
    """Run trials through one chain.

    Parameters
    ----------
    plates
        The trials by plate, at least one on each; see :func:`simulate` and, for other sources than
        the scenes that come with the package, :func:`play`.
    config
        The chain's.

    Returns
    -------
    dict
        ``plates`` and ``all``, as the module's docstring has them.

    Raises
    ------
    ValueError
        When the chain cannot be built or a trial does not suit it; names the plate.
    """
    chain = SlipChain(config)
    outcomes: dict[str, list[Outcome]] = {}
    for plate, trials in plates.items():
        try:
            outcomes[plate] = [outcome(trial, chain) for trial in trials]
        except ValueError as error:
            raise ValueError(f'plate {plate}: {error}') from None
    return {
        'plates': {plate: figures(mine) for plate, mine in outcomes.items()},
        'all': figures([one for mine in outcomes.values() for one in mine]),
    }


def with_windows(config: ChainConfig, window_s: float) -> ChainConfig:
    """Return the configuration with both windows of one length."""
    return dataclasses.replace(config, envelope_window_s=window_s, decision_window_s=window_s)


def with_band(config: ChainConfig, passband_hz: tuple[float, float]) -> ChainConfig:
    """Return the configuration with another pass-band and no stop-band above its own."""
    top_hz = config.passband_hz[1] or np.inf  # 0: a high-pass, above which there is nothing.
    kept = tuple(pair for pair in config.stopbands_hz if pair[0] < top_hz)
    return dataclasses.replace(config, passband_hz=passband_hz, stopbands_hz=kept)


def evaluate_protocol(
    plates: Mapping[str, Sequence[Trial]], config: ChainConfig
) -> dict[str, Any]:
    """Run trials through the chain and its variants of Figs. 4 and 7.

    Parameters
    ----------
    plates
        The trials by plate; those of :data:`SCENES`.
    config
        The chain's.

    Returns
    -------
    dict
        ``plates``, ``all``, ``windows``, ``bands`` and ``wanted``, as the module's docstring has
        them.

    Raises
    ------
    ValueError
        When a chain cannot be built or a trial does not suit it.
    """
    result: dict[str, Any] = evaluate_plates(plates, config)
    result['windows'] = {
        f'{window_s * 1e3:.0f}': evaluate_plates(plates, with_windows(config, window_s))
        for window_s in WINDOWS_S
    }
    result['bands'] = {
        f'{low:g}-{high:g}': evaluate_plates(plates, with_band(config, (low, high)))
        for low, high in BANDS_HZ
    }
    values = claims(result)
    result['wanted'] = {
        name: {'value': values[name], 'bound': str(bound), 'met': bound.met(values[name])}
        for name, bound in WANTED.items()
    }
    return result


def claims(result: Mapping[str, Any]) -> dict[str, float | None]:
    """Return the figures that :data:`WANTED` bounds; None where one is not defined.

    Parameters
    ----------
    result
        ``plates``, ``all``, ``windows`` and ``bands`` of :func:`evaluate_protocol`.
    """
    plates, whole = result['plates'], result['all']
    means = [plates[plate]['mean_delay_ms'] for plate in SCENES]
    windows, bands = result['windows'], result['bands']
    longest = windows[f'{WINDOWS_S[-1] * 1e3:.0f}']['all']['false_positive_percent']
    values = {
        'detected_percent': 100.0 * whole['detected'] / whole['trials'],
        'least_rise_ms': _defined(min, map(_less, means[1:], means[:-1])),
        'worst_false_positive_percent': _defined(
            max, (plates[plate]['false_positive_percent'] for plate in SCENES)
        ),
    }
    for plate, mean in zip(SCENES, means, strict=True):
        values[f'mean_delay_ms.{plate}'] = mean
    for name, part in windows.items():
        more = _less(part['all']['false_positive_percent'], longest)
        values[f'windows.{name}.false_positive_percent_more'] = more
    for name, part in bands.items():
        shorter = [part['plates'][plate]['mean_delay_ms'] for plate in SCENES]
        values[f'bands.{name}.least_shortening_ms'] = _defined(min, map(_less, means, shorter))
    return values


def _less(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a - b


def _defined(pick: Callable[[list[float]], float], values: Iterable[float | None]) -> float | None:
    """Return the least or the most of the values; None where one of them is not defined."""
    known: list[float] = []
    for value in values:
        if value is None:
            return None
        known.append(value)
    return pick(known)


def run(
    config: ChainConfig, trials: int = TRIALS, seed: int = 0, folder: Path | None = None
) -> dict[str, Any]:
    """Simulate the paper's protocol and evaluate it.

    Parameters
    ----------
    config
        The chain's.
    trials
        On each plate.
    seed
        Of the first trial; the next have the next.
    folder
        Where to write the pictures; none without.

    Returns
    -------
    dict
        As the module's docstring has it.

    Raises
    ------
    ValueError
        When the chain cannot be built, does not suit the scenes, or a picture cannot be written.
    """
    seeds = list(range(seed, seed + trials))
    if folder is not None:
        _make(folder)
    plates = {plate: simulate(scene, seeds) for plate, scene in SCENES.items()}
    result = {
        'seeds': seeds,
        'scenes': dict(SCENES),
        'paper': {
            'plates': {
                plate: {'mean_delay_ms': mean, 'sd_delay_ms': sd}
                for plate, (mean, sd) in PAPER_DELAY_MS.items()
            },
            'false_positive_percent': PAPER_FALSE_POSITIVE_PERCENT,
        },
        **evaluate_protocol(plates, config),
    }
    written = [] if folder is None else draw(folder, plates, config, result)
    return {**result, 'plots': [str(path) for path in written]}


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f'{folder}: cannot be made ({error.strerror})') from None


def stages(trial: Trial, config: ChainConfig, channel: int) -> dict[str, Floats]:
    """Return the signals of one channel after each stage of the chain (Eq. 1-8).

    Parameters
    ----------
    trial
        Without bad samples.
    config
        The chain's.
    channel
        Counted from 1, enabled.

    Returns
    -------
    dict
        By what the signal is and its unit, in the order of the stages: arrays of shape (n,). The
        last two are the chain's own envelope and the level that it holds against the threshold.

    Raises
    ------
    ValueError
        When the chain cannot be built.
    """
    result = SlipChain(config).update(trial.volts)
    # As the chain does: what counts is the deviation from the first row (the baseline).
    deviations = trial.volts - trial.volts[0]
    volts = deviations[:, channel - 1]
    if config.common_mode != 'none':
        enabled = [c for c in range(config.channels) if c + 1 not in config.disabled_channels]
        volts = volts - getattr(np, config.common_mode)(deviations[:, enabled], axis=1)
    filtered = signal.sosfilt(design(config), volts)
    rectified = np.abs(filtered) if config.rectify == 'full' else np.maximum(filtered, 0.0)
    unit = 'V' if config.exponent == 1 else f'V$^{config.exponent}$'
    return {
        'raw [V]': trial.volts[:, channel - 1],
        f'filtered,\ntimes {config.gain:g} [V]': filtered,
        f'rectified,\nto the power\nof {config.exponent} [{unit}]': rectified**config.exponent,
        f'RMS envelope\n[{unit}]': result.envelope[:, channel - 1],
        f'mean of the\nenvelope [{unit}]': result.level[:, channel - 1],
    }


def draw(
    folder: Path,
    plates: Mapping[str, Sequence[Trial]],
    config: ChainConfig,
    result: Mapping[str, Any],
) -> list[Path]:
    """Draw the counterparts of the paper's Figs. 2, 4, 5, 6 and 7.

    Parameters
    ----------
    folder
        Where to; is there.
    plates
        The trials by plate. The first of the first plate stands for all in Figs. 2 and 5.
    config
        The chain's.
    result
        Of :func:`evaluate_protocol` on these.

    Returns
    -------
    list of Path
        The pictures.

    Raises
    ------
    ValueError
        When a picture cannot be written; names it.
    """
    from slip_detector import plots

    chain = SlipChain(config)
    decisions = {
        plate: np.array([outcome(trial, chain).on for trial in trials])
        for plate, trials in plates.items()
    }
    first_plate, (trial, *_) = next(iter(plates.items()))
    chain.reset()
    decided = chain.update(trial.volts, envelope=False, level=False)
    channel = next(c for c in range(1, config.channels + 1) if c not in config.disabled_channels)
    of_trial = f'plate of {first_plate} µm, trial with the seed {result["seeds"][0]}'
    paths = {number: folder / f'paper_fig{number}.png' for number in (2, 4, 5, 6, 7)}
    try:
        plots.draw_stages(
            paths[2],
            trial.time_s,
            stages(trial, config, channel),
            decided.channels[:, channel - 1],
            config.threshold,
            trial.motion_s,
            f'{config.names[channel - 1]} from stage to stage; {of_trial}',
        )
        plots.draw_windows(paths[4], _by_plate(result['windows']), PAPER_FALSE_POSITIVE_PERCENT)
        plots.draw_trial(
            paths[5],
            trial.time_s,
            trial.volts,
            config,
            dict(zip(config.groups, decided.groups.T, strict=True)),
            decided.slip,
            trial.motion_s,
            f'Channels by group, decisions of the groups and of all; {of_trial}',
        )
        plots.draw_decisions(
            paths[6],
            {plate: trials[0].time_s for plate, trials in plates.items()},
            {plate: trials[0].position_m for plate, trials in plates.items()},
            decisions,
            {plate: trials[0].motion_s for plate, trials in plates.items()},
        )
        plots.draw_bands(
            paths[7],
            _by_plate(
                {
                    'as configured': result,
                    **{_band(name): part for name, part in result['bands'].items()},
                }
            ),
            PAPER_DELAY_MS,
        )
    except OSError as error:
        raise ValueError(f'{folder}: cannot be written to ({error.strerror})') from None
    return list(paths.values())


def _by_plate(variants: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the figures by plate and variant."""
    plates = next(iter(variants.values()))['plates']
    return {
        plate: {name: part['plates'][plate] for name, part in variants.items()} for plate in plates
    }


def _band(name: str) -> str:
    return f'[{name.replace("-", ", ")}] Hz, no high stop-band'


def table(result: Mapping[str, Any]) -> str:
    """Lay the figures out as text, the paper's beside ours, what is wanted at the end."""
    plates, paper = result['plates'], result['paper']
    seeds = result['seeds']
    heads = ['', *(f'{plate} um' for plate in plates), 'all']
    columns = [*plates.values(), result['all']]

    def row(head: str, key: str, form: str = '.2f') -> list[str]:
        return [head, *(_cell(column[key], form) for column in columns)]

    def paper_row(head: str, key: str) -> list[str]:
        return [head, *(_cell(paper['plates'][plate][key], '.2f') for plate in plates), '']

    lines = [
        f"The paper's protocol: {len(plates)} plates, {len(seeds)} trials on each, "
        f'seeds {seeds[0]} to {seeds[-1]}',
        'Delay [ms] from the start of the plate to the first ON, mean over the channels (Eq. 10)',
        '',
    ]
    trials = [
        [f'seed {seed}', *(_cell(plates[plate]['trial_delays_ms'][k], '.2f') for plate in plates)]
        for k, seed in enumerate(seeds)
    ]
    lines += _aligned(
        [
            heads,
            *([*line, ''] for line in trials),
            row('mean', 'mean_delay_ms'),
            paper_row('mean, paper', 'mean_delay_ms'),
            row('sd', 'sd_delay_ms'),
            paper_row('sd, paper', 'sd_delay_ms'),
            ['detected', *(_of(column) for column in columns)],
            ['success [%]', *(f'{_success_percent(column):.1f}' for column in columns)],
            row('false positives [%]', 'false_positive_percent'),
            [
                'false positives, paper [%]',
                *([''] * len(plates)),
                f'{paper["false_positive_percent"]:.2f}',
            ],
            row('channels without ON', 'channels_without_on', 'd'),
        ]
    )
    lines += [
        '',
        "False positives: share of the time at which the plate stands. The paper's delays of the "
        'single trials are not at hand.',
    ]
    heads = ['', *(f'{plate} um' for plate in plates), 'detected', 'false positives [%]']
    windows = [_variant(f'{name} ms', part) for name, part in result['windows'].items()]
    lines += ['', 'Mean delay [ms] by the length of both windows (as Fig. 4)', '']
    lines += _aligned([heads, *windows])
    bands = [_variant('as configured', result)]
    bands += [_variant(_band(name), part) for name, part in result['bands'].items()]
    lines += ['', 'Mean delay [ms] by band (as Fig. 7)', '']
    lines += _aligned([heads, *bands])
    lines += ['', 'Wanted', '']
    lines += _aligned(
        [
            [
                MEANINGS[name],
                _cell(entry['value'], '.2f'),
                f'wanted {entry["bound"]}',
                'met' if entry['met'] else 'NOT met',
            ]
            for name, entry in result['wanted'].items()
        ]
    )
    if result['plots']:
        lines += ['', f'Written: {", ".join(result["plots"])}']
    return '\n'.join(lines)


def _variant(head: str, part: Mapping[str, Any]) -> list[str]:
    means = [_cell(mine['mean_delay_ms'], '.2f') for mine in part['plates'].values()]
    false_percent = _cell(part['all']['false_positive_percent'], '.2f')
    return [head, *means, _of(part['all']), false_percent]


def _success_percent(part: Mapping[str, Any]) -> float:
    return float(100.0 * part['detected'] / part['trials'])


def _of(part: Mapping[str, Any]) -> str:
    return f'{part["detected"]} of {part["trials"]}'


def _cell(value: float | None, form: str) -> str:
    return '-' if value is None else format(value, form)


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lay rows of text out in columns, the first to the left and the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        '  '.join(['', first.ljust(widths[0]), *map(str.rjust, rest, widths[1:])]).rstrip()
        for first, *rest in rows
    ]
