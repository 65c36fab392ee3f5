"""Where samples come from: one small interface, and what opens each kind of source."""

from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from slip_detector.config import DriverConfig
from slip_detector.recordings import Recording, Rows, open_recording


class Samples(NamedTuple):
    """Consecutive samples, oldest first.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    truth : ndarray of bool, shape (n,), or None
        Whether there is slip, where the source knows.
    position_m : ndarray, shape (n,), or None
        Position of the platform or the object, where there is one.
    time_s : ndarray, shape (n,), or None
        When each was taken, from the first on; None: one each period of the sample rate.
    """

    volts: NDArray[np.float64]
    truth: NDArray[np.bool_] | None = None
    position_m: NDArray[np.float64] | None = None
    time_s: NDArray[np.float64] | None = None


class Source(Protocol):
    """What the driver plays."""

    sample_rate_hz: float
    channel_names: tuple[str, ...]

    def read(self, n: int) -> Samples:
        """Return the next ``n`` samples; fewer than asked for at the end."""


class RecordingSource:
    """A recording as a :class:`Source`: its rows as they were recorded, each at its time.

    Parameters
    ----------
    recording
        Is read in pieces, however long it is.
    """

    def __init__(self, recording: Recording) -> None:
        self.sample_rate_hz = recording.sample_rate_hz
        self.channel_names = recording.channel_names
        self._pieces = recording.rows()
        self._rows = Rows(np.empty((0, len(self.channel_names))), np.empty(0, np.int64), None)
        self._first_ns: int | None = None

    def read(self, n: int) -> Samples:
        """Return the next ``n`` samples; fewer than asked for at the end."""
        rows = self._rows
        while len(rows.volts) < n and (more := next(self._pieces, None)) is not None:
            rows = rows.then(more) if len(rows.volts) else more
            if self._first_ns is None:
                self._first_ns = int(rows.stamps_ns[0])
        self._rows = rows.take(slice(n, None))
        now = rows.take(slice(n))
        after_s = np.asarray((now.stamps_ns - (self._first_ns or 0)) * 1e-9)
        return Samples(now.volts, now.truth, time_s=after_s)


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


def shared_folder() -> Path:
    """Return the folder that holds ``config``: the source tree's or the installed package's.

    Raises
    ------
    ValueError
        When the package was installed without it.
    """
    for parent in Path(__file__).resolve().parents:
        for folder in (parent, parent / 'share' / 'slip_detector'):
            if (folder / 'config' / 'scenes').is_dir() and (folder / 'package.xml').is_file():
                return folder
    raise ValueError('the package was installed without its config folder: install it anew')


def open_source(config: DriverConfig, repetition: int = 0) -> Source:
    """Open what the driver's parameters name, from its beginning.

    Parameters
    ----------
    config
        The driver's parameters.
    repetition
        How often it was played before: a scene gets other noise each time.

    Raises
    ------
    ValueError
        When it cannot be opened; names it.
    """
    if config.source in ('serial', 'udp'):
        raise ValueError(f'parameter source is {config.source!r}, allowed here: scene, recording')
    if config.source == 'recording':
        if not config.recording:
            raise ValueError("parameter recording is '', allowed: a path, as source is recording")
        return RecordingSource(open_recording(config.recording, config))
    # A driver that plays a recording need not load the simulation.
    from slip_detector.scenes.scene import load_scene

    return load_scene(find_scene(config.scene), np.random.default_rng(config.seed + repetition))
