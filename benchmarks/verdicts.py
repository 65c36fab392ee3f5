"""Comparison of the measured figures with what is wanted of them."""

from collections.abc import Mapping
from typing import Any

from slip_detector.evaluation.bounds import Bound


def verdicts(
    bounds: Mapping[str, Bound], values: Mapping[str, float | None], judged: bool = True
) -> dict[str, dict[str, Any]]:
    """Compare each measured figure with what is wanted of it.

    Parameters
    ----------
    bounds
        What is wanted, by claim.
    values
        What was measured, by claim; None where it was not.
    judged
        False when the measurement is too short to be judged.

    Returns
    -------
    dict
        For each claim ``value``, ``bound`` (as text) and ``met``, which is None when nothing was
        measured or judged.

    Examples
    --------
    >>> verdicts({'speedup': Bound(low=10.0)}, {'speedup': 12.5})
    {'speedup': {'value': 12.5, 'bound': '>= 10', 'met': True}}
    """
    return {
        claim: {
            'value': value,
            'bound': str(bound),
            'met': bound.met(value) if judged and value is not None else None,
        }
        for claim, bound in bounds.items()
        for value in (values[claim],)
    }


def verdict_in_words(verdict: Mapping[str, Any]) -> str:
    """Return whether a claim of :func:`verdicts` is met, in words.

    Examples
    --------
    >>> verdict_in_words({'value': 12.5, 'bound': '>= 10', 'met': True})
    'met'
    >>> verdict_in_words({'value': None, 'bound': '>= 10', 'met': None})
    'not measured'
    """
    if verdict['value'] is None:
        return 'not measured'
    return {None: 'not judged', True: 'met', False: 'NOT met'}[verdict['met']]


def claim_in_words(verdict: Mapping[str, Any]) -> str:
    """Return what is wanted and whether it is met, to be printed after the figure.

    Examples
    --------
    >>> claim_in_words({'value': 8.0, 'bound': '>= 10', 'met': False})
    '(wanted >= 10: NOT met)'
    """
    return f'(wanted {verdict["bound"]}: {verdict_in_words(verdict)})'
