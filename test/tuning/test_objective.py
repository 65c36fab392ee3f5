"""What a chain costs, and that the tuner thinks of a chain what an evaluation says of it."""

from hypothesis import assume, given, settings
from hypothesis import strategies as st

from slip_detector.chain.slip_chain import COMPILED
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import Objective
from slip_detector.tuning.tracks import track_of
from slip_detector.tuning.verdict import pooled_figures
from support.track_cases import EVALUATIONS, RATE_HZ, chains, recordings


def evaluated(chain, evaluation, several):
    """Return the figures that the evaluation gives of recordings, as the tuner names them."""
    replay = Replay(chain, evaluation)
    outcomes = [replay.run(pieces, RATE_HZ) for pieces in several]
    figures = pooled_figures(outcomes)
    against_motion = any(one.scores.counts[1].any() for one in outcomes)
    return {
        'missed': figures['missed'] / figures['slips'],
        'false_alarms_per_minute': figures['false_alarms_per_minute'],
        'auc': figures['auc_moving' if against_motion else 'auc_all'],
        'latency_ms': figures['latency_median_ms'],
        'median_ms': figures['latency_median_all_ms'],
    }


def thought(candidate):
    figures = candidate.figures._asdict()
    if figures['median_ms'] == float('inf'):
        figures['median_ms'] = None
    return figures


@settings(max_examples=40 if COMPILED else 3, deadline=None)
@given(chains(), st.lists(recordings(), min_size=1, max_size=3), EVALUATIONS)
def test_the_tuner_thinks_of_a_chain_what_the_evaluation_says_of_it_to_the_bit(
    chain, several, evaluation
):
    tracks = [track_of('a', pieces, RATE_HZ) for pieces in several]
    assume(any(track.slips for track in tracks) and any(track.quiet_s for track in tracks))
    objective = Objective(tracks, evaluation, TuneConfig())
    assert thought(objective.as_it_is(chain)) == evaluated(chain, evaluation, several)
    for candidate in objective.best(chain):
        assert thought(candidate) == evaluated(candidate.chain, evaluation, several)
        assert objective.as_it_is(candidate.chain).figures == candidate.figures
