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

"""The report of a search: the given and the tuned chain on all recordings, and the trials."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from slip_detector.evaluation.figures import ReplayOutcome, figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.report.overview import Overview, cells_of_each, events_of
from slip_detector.report.page import write_page, write_pictures
from slip_detector.report.page_data import SearchTrial, Variant
from slip_detector.tuning.problem import searched
from slip_detector.tuning.tracks import Track


class ChainReplay(NamedTuple):
    """The replay of all recordings through one chain.

    Attributes
    ----------
    chain : ChainConfig
    outcomes : list of ReplayOutcome
        One for each recording.
    overviews : list of Overview
        One for each recording; empty where no report is written.
    """

    chain: ChainConfig
    outcomes: list[ReplayOutcome]
    overviews: list[Overview]


def replay_tracks(
    chain: ChainConfig, tracks: Sequence[Track], evaluation: EvaluationConfig, shown: bool
) -> ChainReplay:
    """Replay recordings through a chain.

    Parameters
    ----------
    chain
        The parameters of the chain.
    tracks
        The recordings.
    evaluation
        What counts as detected.
    shown
        Whether overviews for a report are made.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> rows = Samples.evenly(np.full((380, 16), 4.3), 380.0, np.zeros(380, bool))
    >>> track = track_of('rest', [rows], sample_rate_hz=380.0)
    >>> replay = replay_tracks(ChainConfig(), [track], EvaluationConfig(), shown=True)
    >>> replay.outcomes[0].alarms, replay.overviews[0].rows
    ((), 380)
    """
    replay = Replay(chain, evaluation)
    outcomes, overviews = [], []
    for track in tracks:
        overview = None
        if shown:
            cells = cells_of_each(len(tracks))
            overview = Overview(
                track.name, chain, most_cells=cells, sample_rate_hz=track.sample_rate_hz
            )
        outcome = replay.run(track.rows(), track.sample_rate_hz, overview)
        outcomes.append(outcome)
        if overview is not None:
            overview.events = events_of(outcome)
            overviews.append(overview)
    return ChainReplay(chain, outcomes, overviews)


def _trial(
    number: int | None,
    figures: Mapping[str, Any],
    parameters: dict[str, Any],
    mark: str = '',
) -> SearchTrial:
    """Return a chain as a point of the trade-off."""
    latency_ms = figures['latency_median_ms']
    return SearchTrial(
        number,
        None if latency_ms is None else latency_ms / 1e3,
        figures['false_alarms_per_minute'],
        figures['false_time_percent'],
        figures['sooner_than_chance'],
        parameters,
        mark,
    )


def write_tuning_report(
    page: Path | None,
    folder: Path | None,
    notes: Sequence[str],
    given: ChainReplay,
    tuned: ChainReplay,
    held: Sequence[Track],
    both: dict[str, list[dict[str, Any]]],
    study: Any,
) -> list[Path]:
    """Write the report of a search, and its figures as pictures.

    Parameters
    ----------
    page
        The HTML file to write; None: no page.
    folder
        The folder for the pictures; None: no pictures.
    notes
        The lines that the command prints.
    given, tuned
        Replays of the held-out recordings, followed by those that were tuned on.
    held
        The held-out recordings.
    both
        Figures of the given and of the tuned chain, by ``held out`` and ``tuned on``.
    study
        The study of the search.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    ValueError
        When a file cannot be written; names it.
    """
    variants = []
    for k, (name, one) in enumerate((('given', given), ('tuned', tuned))):
        rows = {f'all {what}': sides[k] for what, sides in both.items()}
        for i, (overview, outcome) in enumerate(zip(one.overviews, one.outcomes, strict=True)):
            what = 'held out' if i < len(held) else 'tuned on'
            rows[f'{overview.name} ({what})'] = figures_of_merit([outcome])
        variants.append(Variant(name, one.chain, one.overviews, rows))
    trials = [
        _trial(trial.number, found['figures'], found['parameters'])
        for trial in study.trials
        for found in trial.user_attrs['found'][:1]
    ]
    shown = [given] if tuned.chain == given.chain else [given, tuned]
    trials += [
        _trial(None, figures, searched(one.chain), variant.name)
        for variant, one, figures in zip(variants, shown, both['tuned on'], strict=False)
    ]
    # The table of the figures is in the report itself.
    few = [line for line in notes if not line.startswith(('  ', 'On what'))]
    written = []
    if page is not None:
        write_page(page, 'Tuning of the slip detector', variants, trials, few)
        written.append(page)
    if folder is not None:
        written += write_pictures(folder, variants, trials)
    return written
