"""Whole recordings, for tests that look at all rows at once."""

import re
from typing import NamedTuple

import numpy as np
import pytest

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


VOLTS = np.array([[4.3, 4.31], [4.25, 4.3], [4.2, 4.29]])


def save_npz(path, **arrays):
    """Write three rows; an array that is None is left out."""
    parts = {'volts': VOLTS, 'sample_rate_hz': 380.0, 'slip': [0, 1, 1], **arrays}
    np.savez(path, **{name: value for name, value in parts.items() if value is not None})
    return path


def save_text(path, text):
    path.write_text(text, encoding='utf-8')
    return path


def complaint(path, config=None):
    """Return what is said of a recording that cannot be read, after its path."""
    with pytest.raises(ValueError, match=re.escape(str(path))) as caught:
        read_recording(path, config)
    assert '\n' not in str(caught.value)
    return str(caught.value).removeprefix(str(path))
