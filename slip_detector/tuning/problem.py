"""What a search is asked, and what its study answers."""

import dataclasses
import hashlib
import math
from typing import TYPE_CHECKING, Any

from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import Candidate, CandidateFigures, Objective
from slip_detector.tuning.space import SearchSpace
from slip_detector.tuning.tracks import Track, fingerprint

if TYPE_CHECKING:
    from slip_detector.tuning.study import Study

#: What of a chain a trial may change, and keeps.
SEARCHED = (
    'common_mode', 'passband_hz', 'stopbands_hz', 'exponent', 'envelope_window_s',
    'decision_window_s', 'threshold', 'vote',
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Problem:
    """What is searched.

    Attributes
    ----------
    tracks : list of Track
        To tune on.
    given : ChainConfig
        What is tuned.
    figures : CandidateFigures or None
        What must not get worse.
    evaluation : EvaluationConfig
        What counts as detected.
    config : TuneConfig
        The weights.
    """

    tracks: list[Track]
    given: ChainConfig
    figures: CandidateFigures | None
    evaluation: EvaluationConfig
    config: TuneConfig

    def study_name(self) -> str:
        """Return a name for the study that no other problem has."""
        asked = (
            fingerprint(self.tracks),
            self.given.to_parameters(),
            self.figures,
            self.evaluation.to_parameters(),
            self.config.to_parameters(),
        )
        return f'{self.config.NODE}-{hashlib.sha256(repr(asked).encode()).hexdigest()[:16]}'

    def objective(self) -> Objective:
        """Return what chains cost on the tracks."""
        return Objective(self.tracks, self.evaluation, self.config, self.figures)

    def candidates_at(self, objective: Objective, point: dict[str, Any]) -> list[Candidate]:
        """Return the chain at a point of the space with the best threshold for each vote.

        Parameters
        ----------
        objective
            See :meth:`objective`.
        point
            See :meth:`slip_detector.tuning.space.SearchSpace.distributions`.

        Returns
        -------
        list of Candidate
            The cheapest first; none where there is no such chain or it never is ON.
        """
        try:
            return objective.best(SearchSpace(self.given).chain(point))
        except ValueError:  # no such filter
            return []

    def study(self, where: str | None, name: str, seed: int) -> 'Study':
        """Open the study of this problem; see :class:`slip_detector.tuning.study.Study`."""
        from slip_detector.tuning.study import Study

        return Study(where, name, SearchSpace(self.given).distributions(), seed)

    def candidates(self, trial: Any) -> list[Candidate]:
        """Return what a finished trial of the study found, a vote each, the cheapest first."""
        return [
            Candidate(
                dataclasses.replace(self.given, **noted['parameters']),
                noted['cost_ms'],
                noted['error_ms'],
                CandidateFigures(**noted['figures']),
            )
            for noted in trial.user_attrs['found']
        ]

    def best(self, study: 'Study') -> Candidate | None:
        """Return the cheapest of all; None where no trial found any."""
        found = [self.candidates(trial)[0] for trial in study.trials]
        return min(found, key=lambda one: one.cost_ms, default=None)

    def choice(self, study: 'Study') -> Candidate | None:
        """Return the result of a search: of what is as good as the best, the nearest to the given.

        As good is what costs no more than the best and its error: the fewer slips there are, the
        less a search among many chains can tell the good from the lucky, and the closer it stays
        to what was given.
        """
        best = self.best(study)
        if best is None:
            return None
        space = SearchSpace(self.given)
        given = space.point(self.given)
        nearest, choice = math.inf, best
        for trial in study.trials:
            away = space.distance(trial.params, given)
            for found in self.candidates(trial):
                if found.cost_ms > best.cost_ms + best.error_ms or self._worse(found, best):
                    continue
                distance = math.hypot(away, found.chain.vote != self.given.vote)
                if distance < nearest:
                    nearest, choice = distance, found
        return choice

    def _worse(self, found: Candidate, best: Candidate) -> bool:
        """Return whether a chain is worse than the given one in what the best is not."""
        if self.figures is None:
            return False
        return len(found.figures.worse_than(self.figures)) > len(
            best.figures.worse_than(self.figures)
        )
