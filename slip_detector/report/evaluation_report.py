"""The report of an evaluation: what it gathers of each recording, the page and the pictures."""

from collections.abc import Callable, Mapping
from pathlib import Path

from slip_detector.evaluation.evaluator import EvaluatedRecording, recording_figures
from slip_detector.evaluation.loading import LabelledRecording
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.evaluation_pictures import draw_evaluation
from slip_detector.report.overview import MOST_CELLS, Overview, events_of
from slip_detector.report.page import write_page, write_pictures
from slip_detector.report.page_data import Variant

#: An overview of each of many recordings has at least so many cells.
LEAST_CELLS = 2**15


def overview_factory(
    config: ChainConfig, recordings: int
) -> Callable[[LabelledRecording], Overview]:
    """Return what makes the overview of a recording.

    Parameters
    ----------
    config
        The chain's.
    recordings
        How many share the room of one report.
    """
    cells = max(MOST_CELLS // recordings, LEAST_CELLS)

    def overview(opened: LabelledRecording) -> Overview:
        name = opened.recording.path.name
        return Overview(name, config, opened.channel_names, cells, opened.sample_rate_hz)

    return overview


def write_evaluation_report(
    sets: Mapping[str, Mapping[str, EvaluatedRecording]],
    config: ChainConfig,
    page: Path | None,
    folder: Path | None,
) -> list[Path]:
    """Write a report and pictures.

    Parameters
    ----------
    sets
        With their overviews.
    config
        The chain's.
    page
        The HTML file; none is written if not given.
    folder
        Where to write pictures; none are if not given.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    ValueError
        When it cannot be written; names it.
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
        lost = [f'{title}: {one.counts.lost}' for title, one in titles.items() if one.counts.lost]
        write_page(page, f'Slips and alarms: {", ".join(sets)}', variants, notes=lost)
        written.append(page)
    if folder is not None:
        written += write_pictures(folder, variants)
        path = folder / 'evaluation.png'
        try:
            draw_evaluation(path, [one.outcome for one in titles.values()])
        except OSError as error:
            raise ValueError(f'{path}: cannot be written ({error.strerror})') from None
        written.append(path)
    return written
