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

"""Compares measured figures with the bounds that are wanted."""

from collections.abc import Mapping
from typing import Any

from slip_detector.evaluation.figures import Bound


def verdicts(
    bounds: Mapping[str, Bound], values: Mapping[str, float | None], judged: bool = True
) -> dict[str, dict[str, Any]]:
    """Compare each measured figure with its bound.

    Parameters
    ----------
    bounds
        The wanted bounds, by claim.
    values
        The measured values, by claim; None for what was not measured.
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


def values_of(
    bounds: Mapping[str, Bound], figures: Mapping[str, Mapping[str, Any]]
) -> dict[str, float | None]:
    """Return the measured values of claims ``part.figure``; None if there is no such figure.

    Examples
    --------
    >>> bounds = {'blocks.speedup': Bound(low=10.0), 'one_row.speedup': Bound(low=11.0)}
    >>> values_of(bounds, {'blocks': {'rows': 5, 'speedup': 12.5}})
    {'blocks.speedup': 12.5, 'one_row.speedup': None}
    """
    places = {claim: claim.split('.') for claim in bounds}
    return {claim: figures.get(part, {}).get(figure) for claim, (part, figure) in places.items()}


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
    """Return the bound and whether it is met, to be printed after the figure.

    Examples
    --------
    >>> claim_in_words({'value': 8.0, 'bound': '>= 10', 'met': False})
    '(wanted >= 10: NOT met)'
    """
    return f'(wanted {verdict["bound"]}: {verdict_in_words(verdict)})'
