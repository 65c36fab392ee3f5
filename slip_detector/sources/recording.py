# Copyright 2026 The slip_detector maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A recording as a source."""

from slip_detector.chain.samples import Samples
from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings import open_recording
from slip_detector.sources.source import Source


class RecordingSource(Source):
    """A recording, with its samples as they were recorded; it is read in pieces.

    Parameters
    ----------
    config
        The driver's parameters, which name the recording and describe its parts.

    Raises
    ------
    ValueError
        When no recording is named, or it cannot be opened; names it.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'trial.npz'
    ...     np.savez(path, volts=np.full((100, 2), 4.3), sample_rate_hz=100.0)
    ...     source = RecordingSource(DriverConfig(source='recording', recording=str(path)))
    ...     len(source.read(60).volts), len(source.read(60).volts)
    (60, 40)
    """

    def __init__(self, config: DriverConfig) -> None:
        if not config.recording:
            raise ValueError("parameter recording is '', allowed: a path, as source is recording")
        recording = open_recording(config.recording, config)
        super().__init__(config.recording, recording.channel_names, recording.sample_rate_hz)
        self._recording, self._pieces = recording, recording.rows()
        self._next: Samples | None = None
        self._first_ns = 0

    @property
    def damage(self) -> str:
        """One line on what could not be read or checked so far; empty if all could."""
        counts = self._recording.counts
        return '; '.join(filter(None, (counts.damage, counts.warnings)))

    def read(self, n: int) -> Samples:
        """Return the next ``n`` samples; fewer only at the end."""
        samples = self._next
        while samples is None or len(samples.volts) < n:
            piece = next(self._pieces, None)
            if piece is None:
                break
            if samples is None:
                self._first_ns = int(piece.stamps_ns[0])
            samples = piece if samples is None else samples.then(piece)
        assert samples is not None  # A recording has at least one row, or reading it fails.
        self._next = samples.take(slice(n, None))
        now = samples.take(slice(n))
        return now._replace(stamps_ns=now.stamps_ns - self._first_ns)
