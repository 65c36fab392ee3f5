"""What is wanted of figures."""

import pytest

from benchmarks.bounds import Bound, verdict_in_words, verdicts


@pytest.mark.parametrize(
    ('bound', 'met', 'not_met'),
    [(Bound('>=', 8), [8, 9], [7.9]), (Bound('<=', 8), [8, 7], [8.1]), (Bound('<', 1), [0], [1])],
)
def test_bounds(bound, met, not_met):
    assert all(bound.met(figure) for figure in met)
    assert not any(bound.met(figure) for figure in not_met)


def test_a_claim_that_was_not_measured_is_neither_met_nor_not():
    bounds = {'a': Bound('<', 1.0), 'b': Bound('>=', 2.0), 'c': Bound('<=', 3.0)}
    assert verdicts(bounds, {'a': 1.0, 'b': 2.0, 'c': None}) == {
        'a': {'value': 1.0, 'bound': '< 1', 'met': False},
        'b': {'value': 2.0, 'bound': '>= 2', 'met': True},
        'c': {'value': None, 'bound': '<= 3', 'met': None},
    }


def test_a_measurement_that_was_too_short_is_not_judged():
    values = {'a': 2.0, 'b': None}
    bounds = {'a': Bound('<', 1.0), 'b': Bound('<', 1.0)}
    words = {
        judged: [verdict_in_words(entry) for entry in verdicts(bounds, values, judged).values()]
        for judged in (True, False)
    }
    assert words == {
        True: ['NOT met', 'not measured'],
        False: ['not judged', 'not measured'],
    }
