"""How fast the chain is, always against something else measured in the same run.

Latencies and processor times end to end are of one stretch of time in which both sides get each
sample in turn.

:func:`measure` gives one object (keys of ``slip_benchmark chain --json``):

``blocks``
    All stages on one block of rows against the same in SciPy and NumPy, from volts to decisions:
    ``rows``, ``channels``, ``rounds``, ``chain_ns_per_row``, ``numpy_ns_per_row``, ``speedup``,
    and ``agreement``, the share of equal decisions for ``slip``, ``groups`` and ``channels``, with
    ``slip_share``, the share of rows with slip. ``tuned`` has ``rows_per_call``,
    ``chain_ns_per_row``, ``numpy_ns_per_row`` and ``speedup`` against the NumPy chain at its best:
    in place, and in blocks that stay in the cache.
``one_row``
    One row per call against one bare ``scipy.signal.sosfilt``: ``channels``, ``calls``,
    ``rounds``, ``chain_us_per_call``, ``sosfilt_us_per_call``, ``speedup``; and the memory of a
    call beyond the arrays of its result: ``kept_bytes_per_call`` after it,
    ``peak_bytes_per_call`` during it (by number of channels), ``temporary_bytes_per_channel``,
    which is what the peak grows by with the channels.
``channels``
    The chain by number of channels: ``channel_samples`` of a call, ``rounds``,
    ``ns_per_channel_sample``, ``ratio`` to 16 channels (both by number of channels) and
    ``worst_ratio``.
``end_to_end``
    Detector node against a bare relay node, or null: ``rate_hz``, ``samples``, ``changes``,
    ``detector`` and ``relay`` with ``median_ms``, ``p99_ms``, ``cpu_percent`` and ``lost``, then
    ``latency_ratio`` (of the medians) and ``cpu_ratio``. How and why so: see
    ``benchmarks.end_to_end``.
``end_to_end_left_out``
    Why ``end_to_end`` is null, else empty.
``wanted``
    For each claim, by ``section.figure``: the measured ``value``, the ``bound`` as text and
    whether it is ``met``; value and met are null where it was not measured.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal as scipy_signal

from benchmarks.command import Bound, gc_off, least_times_s, verdict_words, verdicts
from slip_detector.chain.compiled import COMPILED
from slip_detector.chain.filters import design
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: What is wanted, by section and figure.
WANTED = {
    'blocks.speedup': Bound('>=', 10.0),
    'one_row.speedup': Bound('>=', 8.0),
    'one_row.kept_bytes_per_call': Bound('<', 1.0),
    # The least temporary that could be per channel is a byte.
    'one_row.temporary_bytes_per_channel': Bound('<', 1.0),
    'channels.worst_ratio': Bound('<=', 1.5),
    'end_to_end.latency_ratio': Bound('<=', 1.5),
    'end_to_end.cpu_ratio': Bound('<=', 1.5),
}


class Sizes(NamedTuple):
    """How much is measured.

    Attributes
    ----------
    rows : int
        Of 16 channels, for ``blocks``.
    channel_samples : int
        Of one call, for ``channels``.
    calls : int
        Of one round, for ``one_row``.
    rounds : int
        How often the sides take turns.
    one_row_rounds : int
        The same for ``one_row``, whose rounds are short.
    end_to_end_s : float
        Measured time of the nodes.
    """

    rows: int
    channel_samples: int
    calls: int
    rounds: int
    one_row_rounds: int
    end_to_end_s: float


FULL = Sizes(200_000, 3_200_000, 500, 20, 60, 25.0)
QUICK = Sizes(20_000, 320_000, 200, 3, 10, 4.0)
#: Without Numba the chain takes some 500 times as long.
FULL_INTERPRETED = Sizes(10_000, 20_000, 100, 3, 10, 25.0)
QUICK_INTERPRETED = Sizes(2_000, 10_000, 20, 2, 2, 4.0)

#: NumPy is fastest with about so many rows a call: all that a call touches stays in the
#: second-level cache, and what a call costs by itself does not show.
ROWS_PER_CALL = 4096

CHANNEL_COUNTS = (16, 64, 1024, 10_000)

#: Rounding differs between the two sides, so a level within it of the threshold may fall to
#: either; more than one decision in so many is a fault.
LEAST_AGREEMENT = 1 - 1e-5

BASELINE_V = 4.3

#: For the start of three processes, discovery and the end, beyond the measured time.
END_TO_END_EXTRA_S = 120.0
END_TO_END_GRACE_S = 15.0


def measure(quick: bool = False, with_ros: bool = True) -> dict[str, Any]:
    """Measure all of it; the keys are in the module's docstring."""
    if COMPILED:
        sizes = QUICK if quick else FULL
    else:
        sizes = QUICK_INTERPRETED if quick else FULL_INTERPRETED
    left_out = why_not_ros() if with_ros else '--without-ros was given'
    result: dict[str, Any] = {
        'blocks': blocks(sizes),
        'one_row': one_row(sizes),
        'channels': channels(sizes),
        'end_to_end': None if left_out else end_to_end(sizes.end_to_end_s),
        'end_to_end_left_out': left_out,
    }
    values = {}
    for claim in WANTED:
        section, figure = claim.split('.')
        values[claim] = None if result[section] is None else result[section][figure]
    result['wanted'] = verdicts(WANTED, values, judged=not quick)
    return result


def volts(rows: int, n_channels: int, seed: int = 0) -> Floats:
    """Make noise that swells and fades every 2 s (at 380 Hz), so that slip comes and goes."""
    random = np.random.default_rng(seed)
    swell_v = 0.02 * (1 + np.sin(2 * np.pi * np.arange(rows) / 760))
    return np.asarray(BASELINE_V + swell_v[:, None] * random.standard_normal((rows, n_channels)))


class NumpyChain:
    """The chain as a user of SciPy and NumPy would write it, for whole blocks of rows.

    It has no check of the samples, as such scripts have none: that work is the chain's own.

    Parameters
    ----------
    config
        The chain's.
    first_row
        What the input had been before.
    in_place
        Whether to spare NumPy its temporary arrays and powers: faster, and worse to read.
    """

    def __init__(self, config: ChainConfig, first_row: Floats, in_place: bool = False) -> None:
        self._sections = design(config)
        self._delays = scipy_signal.sosfilt_zi(self._sections)[:, :, None] * first_row
        self._squares = np.zeros((config.samples(config.envelope_window_s), config.channels))
        self._envelopes = np.zeros((config.samples(config.decision_window_s), config.channels))
        self._threshold = config.threshold
        self._members = [np.array(members) - 1 for members in config.groups.values()]
        self._in_place = in_place

    def update(self, rows: Floats) -> tuple[Bools, Bools, Bools]:
        """Take the next rows; return the decisions: slip, groups, channels."""
        y, self._delays = scipy_signal.sosfilt(self._sections, rows, axis=0, zi=self._delays)
        if self._in_place:
            squares = y * y
            squares *= y
            squares *= squares
        else:
            squares = (np.abs(y) ** 3) ** 2
        means, self._squares = self._windowed_mean(squares, self._squares)
        envelope = np.sqrt(means, out=means if self._in_place else None)
        level, self._envelopes = self._windowed_mean(envelope, self._envelopes)
        on = level > self._threshold
        groups = np.stack([on[:, members].all(axis=1) for members in self._members], axis=1)
        return np.any(groups, axis=1), groups, np.asarray(on)

    def _windowed_mean(self, values: Floats, before: Floats) -> tuple[Floats, Floats]:
        """Return the means over the window and the values that the next block needs."""
        window = len(before)
        joined = np.concatenate([before, values])
        kept = joined[-window:].copy()
        sums = np.cumsum(joined, axis=0, out=joined if self._in_place else None)
        # The difference of two sums may come out below zero by their rounding errors.
        if self._in_place:
            means = sums[window:] - sums[:-window]
            means *= 1.0 / window
            return np.maximum(means, 0.0, out=means), kept
        return np.maximum((sums[window:] - sums[:-window]) / window, 0.0), kept


def blocks(sizes: Sizes) -> dict[str, Any]:
    """Compare all stages on blocks of rows with :class:`NumpyChain`."""
    config = ChainConfig()
    rows = volts(sizes.rows, config.channels)
    pieces = [rows[i : i + ROWS_PER_CALL] for i in range(0, len(rows), ROWS_PER_CALL)]
    chain = SlipChain(config)
    plain, tuned = NumpyChain(config, rows[0]), NumpyChain(config, rows[0], in_place=True)
    mine = chain.update(rows)
    agreement = {}
    theirs = zip(
        ('slip', 'groups', 'channels'), plain.update(rows), tuned.update(rows), strict=True
    )
    for name, of_plain, of_tuned in theirs:
        ours = getattr(mine, name)
        agreement[name] = float(min((ours == of_plain).mean(), (ours == of_tuned).mean()))
    if min(agreement.values()) < LEAST_AGREEMENT:
        raise RuntimeError(f'the chain and its NumPy rivals decide differently: {agreement}')

    def chain_pass(parts: list[Floats]) -> Callable[[], None]:
        def run() -> None:
            for part in parts:
                chain.update(part, envelope=False, level=False)  # decisions, as the rivals

        return run

    def rival_pass(rival: NumpyChain, parts: list[Floats]) -> Callable[[], None]:
        def run() -> None:
            for part in parts:
                rival.update(part)

        return run

    sides = [chain_pass([rows]), rival_pass(plain, [rows])]
    sides += [chain_pass(pieces), rival_pass(tuned, pieces)]
    times_ns = [time_s / len(rows) * 1e9 for time_s in least_times_s(sides, sizes.rounds)]
    return {
        'rows': len(rows),
        'channels': config.channels,
        'rounds': sizes.rounds,
        'chain_ns_per_row': times_ns[0],
        'numpy_ns_per_row': times_ns[1],
        'speedup': times_ns[1] / times_ns[0],
        'agreement': agreement,
        'slip_share': float(mine.slip.mean()),
        'tuned': {
            'rows_per_call': min(ROWS_PER_CALL, len(rows)),
            'chain_ns_per_row': times_ns[2],
            'numpy_ns_per_row': times_ns[3],
            'speedup': times_ns[3] / times_ns[2],
        },
    }


def one_row(sizes: Sizes) -> dict[str, Any]:
    """Compare one row per call with one bare call of sosfilt on the same row."""
    config = ChainConfig()
    block = volts(sizes.calls, config.channels)
    rows = [block[i : i + 1] for i in range(len(block))]
    chain, sections = SlipChain(config), design(config)
    delays = scipy_signal.sosfilt_zi(sections)[:, :, None] * rows[0]

    def chain_calls() -> None:
        for row in rows:
            chain.update(row)

    def sosfilt_calls() -> None:
        zi = delays
        for row in rows:
            _, zi = scipy_signal.sosfilt(sections, row, axis=0, zi=zi)

    chain_s, sosfilt_s = least_times_s([chain_calls, sosfilt_calls], sizes.one_row_rounds)
    few, many = config.channels, 64 * config.channels
    kept, few_peak = memory_of_a_call(few, 1000)
    _, many_peak = memory_of_a_call(many, 1)
    return {
        'channels': config.channels,
        'calls': sizes.calls,
        'rounds': sizes.one_row_rounds,
        'chain_us_per_call': chain_s / sizes.calls * 1e6,
        'sosfilt_us_per_call': sosfilt_s / sizes.calls * 1e6,
        'speedup': sosfilt_s / chain_s,
        'kept_bytes_per_call': kept,
        'peak_bytes_per_call': {str(few): few_peak, str(many): many_peak},
        'temporary_bytes_per_channel': (many_peak - few_peak) / (many - few),
    }


def memory_of_a_call(n_channels: int, calls: int) -> tuple[float, int]:
    """Measure the memory of one-row calls beyond the arrays of their result.

    Parameters
    ----------
    n_channels
        Of a row.
    calls
        Over which what is kept is averaged.

    Returns
    -------
    kept : float
        Bytes per call that are still held when the result is gone.
    peak : int
        Most bytes during a call: headers of the result's arrays and Python's own objects.
    """
    chain = SlipChain(ChainConfig(channels=n_channels))
    row = volts(1, n_channels)
    with gc_off():
        tracemalloc.start()
        try:
            for _ in range(10):
                chain.update(row)
            before = tracemalloc.get_traced_memory()[0]
            for _ in range(calls):
                chain.update(row)
            after = tracemalloc.get_traced_memory()[0]
            tracemalloc.reset_peak()
            start = tracemalloc.get_traced_memory()[0]
            result = chain.update(row)
            peak = tracemalloc.get_traced_memory()[1] - start
        finally:
            tracemalloc.stop()
    arrays = result.flags.nbytes + result.envelope.nbytes + result.level.nbytes
    return max(0, after - before) / calls, peak - arrays


def channels(sizes: Sizes) -> dict[str, Any]:
    """Measure the chain on 16 to 10,000 channels in groups of four."""
    passes = []
    for n in CHANNEL_COUNTS:
        groups = {f'g{i}': tuple(range(4 * i + 1, 4 * i + 5)) for i in range(n // 4)}
        chain = SlipChain(ChainConfig(channels=n, groups=groups))
        passes.append(_pass_of(chain, volts(sizes.channel_samples // n, n)))
    times_s = least_times_s(passes, sizes.rounds)
    ns_per = {}
    for n, time_s in zip(CHANNEL_COUNTS, times_s, strict=True):
        ns_per[str(n)] = time_s / (sizes.channel_samples // n * n) * 1e9
    ratio = {n: ns / ns_per[str(CHANNEL_COUNTS[0])] for n, ns in ns_per.items()}
    return {
        'channel_samples': sizes.channel_samples,
        'rounds': sizes.rounds,
        'ns_per_channel_sample': ns_per,
        'ratio': ratio,
        'worst_ratio': max(ratio.values()),
    }


def _pass_of(chain: SlipChain, rows: Floats) -> Callable[[], None]:
    def run() -> None:
        chain.update(rows)

    return run


def why_not_ros() -> str:
    """Return why the nodes cannot run here; empty when they can."""
    # In a process of its own: importing rclpy may restart the interpreter.
    probe = subprocess.run(
        [sys.executable, '-c', 'import rclpy, sensor_msgs.msg, std_msgs.msg'],
        capture_output=True, text=True, timeout=END_TO_END_EXTRA_S, check=False,
    )  # fmt: skip
    if probe.returncode == 0:
        return ''
    return f'rclpy cannot be imported ({last_line(probe.stderr)})'


def end_to_end(seconds: float) -> dict[str, Any]:
    """Measure detector and relay as processes, by a third process.

    Raises
    ------
    RuntimeError
        When that process fails or does not end in time.
    """
    command = [sys.executable, '-m', 'benchmarks.end_to_end', 'measure']
    # The nodes are on one machine and need no network.
    environment = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'} | dict(os.environ)
    # A session of its own: a Ctrl-C reaches this process only, which then ends the others in
    # their order; and nothing outlives a process that had to be killed.
    process = subprocess.Popen(
        [*command, '--seconds', str(seconds)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
        start_new_session=True,
    )  # fmt: skip
    try:
        output, errors = process.communicate(timeout=seconds + END_TO_END_EXTRA_S)
    except subprocess.TimeoutExpired:
        raise RuntimeError('the measurement end to end did not end in time') from None
    finally:
        end_session(process)
    if process.returncode:
        raise RuntimeError(f'the measurement end to end failed: {last_line(errors)}')
    result: dict[str, Any] = json.loads(output)
    return result


def end_session(process: 'subprocess.Popen[str]') -> None:
    """End a process gently, then whatever is left of its session."""
    if process.poll() is None:
        process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.communicate(timeout=END_TO_END_GRACE_S)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def last_line(text: str) -> str:
    """Return the last line that a process said."""
    lines = text.strip().splitlines()
    return lines[-1] if lines else 'it said nothing'


def table(result: dict[str, Any]) -> str:
    """Lay the figures out as text, the wanted bound beside each claim."""

    def claim(name: str) -> str:
        entry = result['wanted'][name]
        return f'(wanted {entry["bound"]}: {verdict_words(entry)})'

    part, tuned = result['blocks'], result['blocks']['tuned']
    agreement = ', '.join(f'{name} {share:.5%}' for name, share in part['agreement'].items())
    lines = [
        f'Blocks       {part["rows"]:,} rows of {part["channels"]} channels, '
        f'least of {part["rounds"]} rounds',
        f'  SlipChain.update           {part["chain_ns_per_row"]:10.1f} ns a row',
        f'  SciPy and NumPy            {part["numpy_ns_per_row"]:10.1f} ns a row',
        f'  speed-up                   {part["speedup"]:10.2f} times  {claim("blocks.speedup")}',
        f'  and with NumPy in place, both {tuned["rows_per_call"]:,} rows a call:',
        f'    SlipChain.update         {tuned["chain_ns_per_row"]:10.1f} ns a row',
        f'    SciPy and NumPy          {tuned["numpy_ns_per_row"]:10.1f} ns a row',
        f'    speed-up                 {tuned["speedup"]:10.2f} times',
        f'  equal decisions            {agreement} (slip in {part["slip_share"]:.0%} of the rows)',
    ]
    part = result['one_row']
    peaks = ', '.join(f'{peak} at {n} channels' for n, peak in part['peak_bytes_per_call'].items())
    lines += [
        '',
        f'One row a call  {part["channels"]} channels, {part["calls"]} calls, '
        f'least of {part["rounds"]} rounds',
        f'  SlipChain.update           {part["chain_us_per_call"]:10.2f} us a call',
        f'  one bare sosfilt           {part["sosfilt_us_per_call"]:10.2f} us a call',
        f'  speed-up                   {part["speedup"]:10.2f} times  {claim("one_row.speedup")}',
        '  memory beyond the arrays of the result:',
        f'    kept                     {part["kept_bytes_per_call"]:10.2f} bytes a call  '
        f'{claim("one_row.kept_bytes_per_call")}',
        f'    temporary arrays         {part["temporary_bytes_per_channel"]:10.2f} bytes a channel'
        f'  {claim("one_row.temporary_bytes_per_channel")}',
        f'    peak of a call, headers and Python objects: bytes {peaks}',
    ]
    part = result['channels']
    lines += [
        '',
        f'Channels     {part["channel_samples"]:,} channel-samples a call, '
        f'least of {part["rounds"]} rounds',
    ]
    lines += [
        f'  {int(n):6,} channels            {ns:10.2f} ns a channel-sample, '
        f'{part["ratio"][n]:.2f} times that of {CHANNEL_COUNTS[0]}'
        for n, ns in part['ns_per_channel_sample'].items()
    ]
    lines.append(
        f'  worst ratio                {part["worst_ratio"]:10.2f} times  '
        f'{claim("channels.worst_ratio")}'
    )
    return '\n'.join(lines + _end_to_end_lines(result, claim))


def _end_to_end_lines(result: dict[str, Any], claim: Callable[[str], str]) -> list[str]:
    part = result['end_to_end']
    if part is None:
        bounds = ', '.join(
            f'{name.split(".")[1]} wanted {bound}'
            for name, bound in WANTED.items()
            if name.startswith('end_to_end.')
        )
        return ['', f'End to end   left out: {result["end_to_end_left_out"]} ({bounds})']
    lines = [
        '',
        f'End to end   {part["samples"]:,} samples at {part["rate_hz"]:g} Hz to each node, '
        f'taking turns; {part["changes"]:,} changes of slip',
    ]
    for name in ('detector', 'relay'):
        node = part[name]
        lines.append(
            f'  {name:<9} latency median {node["median_ms"]:.3f} ms, p99 {node["p99_ms"]:.3f} ms; '
            f'{node["cpu_percent"]:.1f} % of a core; {node["lost"]} changes lost'
        )
    return [
        *lines,
        f'  ratio of the medians       {part["latency_ratio"]:10.2f} times  '
        f'{claim("end_to_end.latency_ratio")}',
        f'  ratio of processor times   {part["cpu_ratio"]:10.2f} times  '
        f'{claim("end_to_end.cpu_ratio")}',
    ]
