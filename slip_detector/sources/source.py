"""Where samples come from: one small interface, and what opens each kind of source."""

from collections.abc import Callable

import numpy as np

from slip_detector.chain.samples import Samples, Source
from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings import RecordedRows, Recording, open_recording
from slip_detector.sources.live import LiveSource


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
        self._rows = RecordedRows(
            np.empty((0, len(self.channel_names))), np.empty(0, np.int64), None
        )
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
    from slip_detector.scenes import find_scene, load_scene

    return load_scene(find_scene(config.scene), np.random.default_rng(config.seed + repetition))


def open_live_source(config: DriverConfig, now_ns: Callable[[], int]) -> LiveSource:
    """Begin to listen to the sensor that the driver's parameters name.

    Parameters
    ----------
    config
        The driver's parameters.
    now_ns
        The clock of the stamps.

    Raises
    ------
    ValueError
        When a parameter does not allow it. A serial port that is not there is waited for.
    """
    # pyserial is loaded by those who use it.
    if config.source == 'serial':
        from slip_detector.sources.serial_port import SerialSource

        return SerialSource(config, now_ns)
    from slip_detector.sources.udp import UdpSource

    return UdpSource(config, now_ns)
