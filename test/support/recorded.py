"""Whole recordings, for tests that look at all rows at once."""

from typing import NamedTuple

import numpy as np

from slip_detector.recordings import open_recording


class Whole(NamedTuple):
    volts: np.ndarray
    sample_rate_hz: float
    channel_names: tuple
    truth: np.ndarray | None
    arrays: dict


def read_recording(path, config=None):
    """Read all rows of a recording as they were recorded."""
    recording = open_recording(path, config)
    rows = list(recording.rows())
    truth = [part.truth for part in rows if part.truth is not None]
    return Whole(
        np.concatenate([part.volts for part in rows]),
        recording.sample_rate_hz,
        recording.channel_names,
        np.concatenate(truth) if truth else None,
        {name: recording.array(name) for name in recording.array_names()},
    )
