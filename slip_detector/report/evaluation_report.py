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

"""The report of an evaluation: the overviews of its recordings, the page and the pictures."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from slip_detector.evaluation.evaluator import (
    EvaluatedRecording,
    LabelledRecording,
    recording_figures,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.evaluation_pictures import draw_evaluation
from slip_detector.report.overview import Overview, cells_of_each, events_of
from slip_detector.report.page import write_page, write_pictures
from slip_detector.report.page_data import Variant


def overview_factory(
    config: ChainConfig, recordings: int
) -> Callable[[LabelledRecording], Overview]:
    """Return a function that makes the overview of an opened recording.

    Parameters
    ----------
    config
        The parameters of the chain.
    recordings
        Number of recordings of the report, which share its cells.
    """
    # Not a closure, as it is pickled for other processes.
    return partial(_overview, config, cells_of_each(recordings))


def _overview(config: ChainConfig, cells: int, opened: LabelledRecording) -> Overview:
    name = opened.recording.path.name
    return Overview(name, config, opened.channel_names, cells, opened.sample_rate_hz)


def write_evaluation_report(
    sets: Mapping[str, Mapping[str, EvaluatedRecording]],
    config: ChainConfig,
    page: Path | None,
    folder: Path | None,
) -> list[Path]:
    """Write the page and the pictures of an evaluation.

    Parameters
    ----------
    sets
        The evaluated recordings by the names of set and file; the observer of each is an overview.
    config
        The parameters of the chain.
    page
        The HTML file to write; None: no page.
    folder
        The folder for the pictures; None: no pictures.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    ValueError
        When a file cannot be written; names it.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from slip_detector.evaluation.evaluator import RecordingLoader, evaluate_recording
    >>> from slip_detector.parameters import EvaluationConfig, RecordingConfig
    >>> config = ChainConfig()
    >>> loader = RecordingLoader(config)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     rest, page = Path(folder) / 'rest.npz', Path(folder) / 'report.html'
    ...     np.savez(rest, volts=np.full((100, 16), 4.3), sample_rate_hz=380.0, slip=np.zeros(100))
    ...     one = evaluate_recording(loader, rest, overview_factory(config, recordings=1))
    ...     written = write_evaluation_report({'rest': {'rest.npz': one}}, config, page, None)
    ...     [path.name for path in written]
    ['report.html']
    """
    titles = {
        (f'{name}/{file}' if len(sets) > 1 else file): one
        for name, files in sets.items()
        for file, one in files.items()
    }
    overviews = []
    for title, one in titles.items():
        assert isinstance(one.observer, Overview)
        one.observer.name = title
        one.observer.events = events_of(one.outcome)
        overviews.append(one.observer)
    figures = {title: recording_figures([one]) for title, one in titles.items()}
    figures['all recordings'] = recording_figures(titles.values())
    variants = [Variant('given', config, overviews, figures)]
    written = []
    if page is not None:
        notes = [
            f'{title}: {line}'
            for title, one in titles.items()
            for line in (one.counts.damage, one.counts.warnings)
            if line
        ]
        write_page(page, f'Slips and alarms: {", ".join(sets)}', variants, notes=notes)
        written.append(page)
    if folder is not None:
        written += write_pictures(folder, variants)
        path = folder / 'evaluation.png'
        draw_evaluation(path, [one.outcome for one in titles.values()])
        written.append(path)
    return written
