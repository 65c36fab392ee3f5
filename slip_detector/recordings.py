"""Read recordings: rows of volts with their rate and labels, from npz and csv files."""

import csv
import dataclasses
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.config import DriverConfig

Floats = NDArray[np.float64]

#: How far single time steps of a csv file may be from their median, as a share of it.
TIME_TOLERANCE = 0.5


@dataclasses.dataclass(frozen=True)
class Recording:
    """Samples at one rate.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    sample_rate_hz : float
    channel_names : tuple of str, length c
    truth : ndarray of bool, shape (n,), or None
        Whether there is slip, where the recording says so.
    arrays : mapping
        All arrays of the file by name, for those who look for more than that.
    """

    volts: Floats
    sample_rate_hz: float
    channel_names: tuple[str, ...]
    truth: NDArray[np.bool_] | None
    arrays: Mapping[str, NDArray[Any]]


def read_recording(path: str | Path, config: DriverConfig | None = None) -> Recording:
    """Read a recording.

    An npz file holds the rows under ``recording_volts_key``, the rate under
    ``recording_rate_key`` and perhaps the label under ``recording_truth_key``. A csv file has a
    line of names, a column ``time_s`` that rises evenly, perhaps a column of the label, and a
    column for each channel.

    Parameters
    ----------
    path
        The file.
    config
        Names of the parts of the file; the driver's defaults if not given.

    Raises
    ------
    ValueError
        When the file is missing, broken or lacks a part; names the file and the part.
    """
    config = config or DriverConfig()
    suffix = Path(path).suffix
    if suffix not in ('.npz', '.csv'):
        raise ValueError(f'{path}: is {suffix or "without ending"}, allowed: .npz, .csv')
    try:
        recording = (_read_npz if suffix == '.npz' else _read_csv)(Path(path), config)
    except OSError as error:
        raise ValueError(f'{path}: cannot be read ({error.strerror or error})') from None
    except MemoryError:
        raise ValueError(f'{path}: does not fit into the memory') from None
    except (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError, UnicodeError, csv.Error):
        # zipfile has RuntimeErrors for encryption and compression that it cannot undo.
        raise ValueError(f'{path}: is broken or not {suffix[1:]}') from None
    if not recording.volts.size:
        raise ValueError(f'{path}: has no samples')
    if recording.truth is not None and len(recording.truth) != len(recording.volts):
        raise ValueError(
            f'{path}: {config.recording_truth_key} has {len(recording.truth)} rows, '
            f'allowed: {len(recording.volts)}, as {config.recording_volts_key}'
        )
    return recording


def _read_npz(path: Path, config: DriverConfig) -> Recording:
    try:
        # np.load leaves a broken file open, and takes what is not npz at all.
        with open(path, 'rb') as stream, np.lib.npyio.NpzFile(stream) as file:
            arrays = {name: np.asarray(file[name]) for name in file.files}
    except ValueError as error:
        raise ValueError(f'{path}: is broken or not npz ({error})') from None
    for key in (config.recording_volts_key, config.recording_rate_key):
        if key not in arrays:
            raise ValueError(f'{path}: has no array {key}, there are: {", ".join(sorted(arrays))}')
    volts, rate = arrays[config.recording_volts_key], arrays[config.recording_rate_key]
    if volts.ndim != 2 or volts.dtype.kind not in 'fiu':
        raise ValueError(
            f'{path}: {config.recording_volts_key} has the shape {volts.shape} and type '
            f'{volts.dtype}, allowed: numbers of shape (rows, channels)'
        )
    if rate.size != 1 or rate.dtype.kind not in 'fiu' or not 0.0 < rate.item() < np.inf:
        raise ValueError(f'{path}: {config.recording_rate_key} is {rate}, allowed: a rate in Hz')
    truth = arrays.get(config.recording_truth_key)
    names = tuple(f'ch{i + 1}' for i in range(volts.shape[1]))
    return Recording(
        volts.astype(np.float64),
        float(rate.item()),
        names,
        _as_truth(truth, config.recording_truth_key, path),
        arrays,
    )


def _as_truth(label: NDArray[Any] | None, key: str, path: Path) -> NDArray[np.bool_] | None:
    """Convert the label of true slip; NaN or 'False' are not taken for slip."""
    if label is None:
        return None
    wrong = label[~np.isin(label, (0, 1))] if label.dtype.kind in 'biuf' else label.reshape(-1)
    if wrong.size:
        raise ValueError(f'{path}: {key} has {wrong.tolist()[0]!r}, allowed: 0 and 1')
    return np.asarray(label, dtype=bool).reshape(-1)


def _read_csv(path: Path, config: DriverConfig) -> Recording:
    with open(path, newline='', encoding='utf-8-sig') as file:  # Spreadsheets write a mark.
        lines = csv.reader(file)
        names = [name.strip() for name in next(lines, [])]
        if 'time_s' not in names:
            raise ValueError(f'{path}: line 1 has no column time_s, there are: {", ".join(names)}')
        rows = []
        for line in lines:
            if not line:  # an empty line, as many programs leave at the end
                continue
            try:
                rows.append([float(cell) for cell in line])
            except ValueError as error:
                raise ValueError(f'{path}: line {lines.line_num}: {error}') from None
            if len(line) != len(names):
                raise ValueError(
                    f'{path}: line {lines.line_num} has {len(line)} columns, allowed: {len(names)}'
                )
    table = np.array(rows, dtype=np.float64).reshape(len(rows), len(names))
    arrays = dict(zip(names, table.T, strict=True))
    if len(arrays) != len(names):
        raise ValueError(f'{path}: line 1 has a name twice, allowed: each column once')
    channels = tuple(n for n in names if n not in ('time_s', config.recording_truth_key))
    times = arrays['time_s']
    steps = np.diff(times) if np.isfinite(times).all() else np.empty(0)
    step = float(np.median(steps)) if steps.size else 0.0
    if not step > 0.0 or np.any(np.abs(steps - step) > TIME_TOLERANCE * step):
        raise ValueError(f'{path}: column time_s does not rise evenly, allowed: one rate')
    rate = len(steps) / float(times[-1] - times[0])
    truth = arrays.get(config.recording_truth_key)
    return Recording(
        np.column_stack([arrays[name] for name in channels]) if channels else np.empty((0, 0)),
        rate,
        channels,
        _as_truth(truth, config.recording_truth_key, path),
        arrays,
    )
