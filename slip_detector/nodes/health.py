"""How the detector and its input are, in words for those who look after the hand."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.detector import DetectorConfig

#: Share by which the measured rate may be off before it is a warning, and an error.
RATE_WARNING, RATE_ERROR = 0.02, 0.05

#: Share of the time that the rows of a second may take before it is a warning, and an error.
LOAD_WARNING, LOAD_ERROR = 0.5, 0.9

#: Names listed before the rest is only counted.
LISTED = 8


class Level(IntEnum):
    """As ``diagnostic_msgs/DiagnosticStatus`` has them."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass
class Status:
    """One line of the diagnostics."""

    name: str
    level: Level = Level.OK
    #: What is wrong, the worst first.
    complaints: list[tuple[Level, str]] = field(default_factory=list)
    values: dict[str, str] = field(default_factory=dict)
    #: Said when nothing is wrong.
    all_well: str = ''

    def complain(self, level: Level, words: str) -> None:
        """Note what is wrong."""
        self.complaints.append((level, words))
        self.level = max(self.level, level)

    @property
    def message(self) -> str:
        """One line: what is wrong, the worst first, or that all is well."""
        worst_first = sorted(self.complaints, key=lambda complaint: -complaint[0])
        return '; '.join(words for _, words in worst_first) or self.all_well


class Health:
    """Notes what comes in, and sums it up from time to time.

    Noting is cheap, for each row; what there is to compute is computed when it is summed up.

    Parameters
    ----------
    config
        What the input should be.
    """

    def __init__(self, config: DetectorConfig) -> None:
        self.config = config
        #: Counts since the start, by kind.
        self.totals: Counter[str] = Counter()
        self._totals_before: Counter[str] = Counter()
        self._rows: list[NDArray[np.float64]] = []
        self._valid: list[NDArray[np.bool_]] = []
        # Of the samples' own times: the last one before this summary's, and the last one.
        self._stamp_before_ns: int | None = None
        self._stamp_ns: int | None = None
        self._rows_between = 0
        self._spent_s = self._longest_s = 0.0
        self._ages_s: list[float] = []

    def note_rows(
        self,
        rows: NDArray[np.float64],
        valid: NDArray[np.bool_],
        stamp_ns: int,
        age_s: float,
        spent_s: float,
    ) -> None:
        """Note rows that were decided on.

        Parameters
        ----------
        rows, valid
            Volts, and whether they are good; shape (n, channels).
        stamp_ns
            When the last of them was sampled.
        age_s
            How long ago that was, by the node's clock, when they had been decided on.
        spent_s
            How long it took.
        """
        self._rows.append(rows)
        self._valid.append(valid)
        self.totals['rows'] += len(rows)
        if self._stamp_before_ns is None:
            self._stamp_before_ns = stamp_ns
        else:
            self._rows_between += len(rows)
        self._stamp_ns = stamp_ns
        self._ages_s.append(age_s)
        self._spent_s += spent_s
        self._longest_s = max(self._longest_s, spent_s)

    def restart(self) -> None:
        """Measure the rate from the next sample on: the stamps have jumped."""
        self._stamp_before_ns = self._stamp_ns = None
        self._rows_between = 0

    def summary(
        self, passed_s: float, *, silent_s: float, slip: bool, valid: bool
    ) -> list[Status]:
        """Sum up what was noted since the last summary.

        Parameters
        ----------
        passed_s
            Time since then.
        silent_s
            Time since the last row; infinite when there was none yet.
        slip, valid
            The present state.
        """
        now = self.totals - self._totals_before
        statuses = [
            self._input(now, silent_s),
            self._channels(),
            self._decisions(now, passed_s, slip, valid),
        ]
        self._totals_before = self.totals.copy()
        self._rows, self._valid = [], []
        self._stamp_before_ns, self._rows_between = self._stamp_ns, 0
        self._spent_s = self._longest_s = 0.0
        self._ages_s = []
        return statuses

    def rate_hz(self) -> float | None:
        """Return the rate of the rows since the last summary, by their stamps; None: unknown."""
        if self._stamp_ns is None or self._stamp_before_ns is None or not self._rows_between:
            return None
        return self._rows_between * 1e9 / (self._stamp_ns - self._stamp_before_ns)

    def _input(self, now: Counter[str], silent_s: float) -> Status:
        config = self.config
        status = Status('input')
        wanted_hz, rate_hz = config.sample_rate_hz, self.rate_hz()
        if math.isinf(silent_s):
            status.complain(
                Level.ERROR, 'no samples yet: does the sensor run, on this topic, with this type?'
            )
        elif silent_s > config.input_timeout_s:
            status.complain(
                Level.ERROR,
                f'no samples for {silent_s:.1f} s: is the sensor plugged in, does its driver run?',
            )
        elif rate_hz is not None:
            off = abs(rate_hz / wanted_hz - 1.0)
            level = Level.ERROR if off > RATE_ERROR else Level.WARN
            if off > RATE_WARNING:
                status.complain(
                    level,
                    f'{rate_hz:.1f} samples a second, {wanted_hz:g} configured: the filters are '
                    f'off by the same {100 * off:.0f} %',
                )
            status.all_well = f'{rate_hz:.1f} samples a second'
        for kind, words in COMPLAINTS.items():
            if now[kind]:
                level = Level.ERROR if kind in ('channels', 'names', 'field') else Level.WARN
                status.complain(level, words.format(now[kind]))
        status.values = {
            'configured rate [Hz]': f'{wanted_hz:g}',
            'measured rate [Hz]': _number(rate_hz, '.2f'),
            AGE_KEYS[0]: _milliseconds(self._ages_s, 50),
            AGE_KEYS[1]: _milliseconds(self._ages_s, 99),
            'silent for [s]': '-' if math.isinf(silent_s) else f'{silent_s:.1f}',
            'samples': str(self.totals['rows']),
            **{COUNT_KEYS[kind]: str(self.totals[kind]) for kind in COUNT_KEYS},
        }
        return status

    def _channels(self) -> Status:
        config = self.config
        disabled = {channel - 1 for channel in config.disabled_channels}
        status = Status('channels')
        n_enabled = config.channels - len(disabled)
        if not self._rows:
            status.complain(Level.ERROR, 'nothing is known of the channels without samples')
            return status
        rows, valid = np.concatenate(self._rows), np.concatenate(self._valid)
        low, high = config.valid_range_v
        kinds = {
            'not a number': ~np.isfinite(rows),
            'at the lower rail': rows <= low,
            'at the upper rail': rows >= high,
        }
        bad = np.zeros(rows.shape, np.bool_)
        for mask in kinds.values():
            bad |= mask
        kinds['flat'] = ~valid & ~bad
        for kind, mask in kinds.items():
            names = [
                config.names[c] for c in np.flatnonzero(mask.any(axis=0)) if int(c) not in disabled
            ]
            status.values[kind] = ', '.join(names) or '-'
            if names:
                level = Level.ERROR if len(names) == n_enabled else Level.WARN
                status.complain(level, f'{kind}: {listed(names)}: {ADVICE[kind]}')
        now_valid = int(valid[-1].sum())
        status.values['valid now'] = f'{now_valid} of {n_enabled}'
        status.values['disabled'] = ', '.join(config.names[c] for c in sorted(disabled)) or '-'
        status.all_well = f'all {n_enabled} channels are valid'
        return status

    def _decisions(self, now: Counter[str], passed_s: float, slip: bool, valid: bool) -> Status:
        status = Status('decisions')
        rows = sum(len(rows) for rows in self._rows)
        load = self._spent_s / passed_s if passed_s > 0 else 0.0
        if not valid:
            status.complain(Level.ERROR, 'slip_valid is false: slip says nothing')
        if load > LOAD_WARNING:
            level = Level.ERROR if load > LOAD_ERROR else Level.WARN
            status.complain(
                level, f'rows take {100 * load:.0f} % of the time: the machine is too slow or busy'
            )
        status.values = {
            'slip': 'ON' if slip else 'OFF',
            'slip_valid': 'true' if valid else 'false',
            'onsets': str(self.totals['onsets']),
            'onsets since the last report': str(now['onsets']),
            'time per row [ms]': _number(self._spent_s / rows * 1e3 if rows else None, '.3f'),
            'longest [ms]': _number(self._longest_s * 1e3 if rows else None, '.3f'),
            'share of the time [%]': f'{100 * load:.1f}',
        }
        status.all_well = f'slip is {"ON" if slip else "OFF"}'
        return status


#: What is said of events that were counted since the last summary.
COMPLAINTS: Mapping[str, str] = {
    'bridged': '{} samples lost and bridged with the last one: check cable, network, load',
    'reset': 'restarted {} times: a long gap, or the clock of the samples was set',
    'backwards': '{} samples dropped: late, or stamped before the ones already seen',
    'channels': '{} samples dropped: not as many channels as configured',
    'names': '{} samples dropped: other channel names than before or configured',
    'field': '{} samples dropped: input_field is not in them',
}

#: Names of the counts in the values.
COUNT_KEYS: Mapping[str, str] = {
    'bridged': 'lost and bridged',
    'reset': 'restarts',
    'backwards': 'dropped, late',
    'channels': 'dropped, wrong number of channels',
    'names': 'dropped, wrong names',
    'field': 'dropped, no such field',
}

#: How old the samples are when they have been decided on.
AGE_KEYS = ('age of the samples, median [ms]', 'age of the samples, 99 % below [ms]')

ADVICE: Mapping[str, str] = {
    'not a number': 'the sensor or its driver sends no value',
    'at the lower rail': 'unplugged, broken or overloaded?',
    'at the upper rail': 'unplugged, broken or overloaded?',
    'flat': 'repeats one value, broken?',
}


def listed(names: Sequence[str]) -> str:
    """List names, the first ones only where there are many."""
    if len(names) <= LISTED:
        return ', '.join(names)
    return f'{", ".join(names[:LISTED])} and {len(names) - LISTED} more'


def _milliseconds(times_s: list[float], percentile: float) -> str:
    return f'{np.percentile(times_s, percentile) * 1e3:.3f}' if times_s else '-'


def _number(value: float | None, how: str) -> str:
    return '-' if value is None else format(value, how)
