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

"""Changes of parameters in use: what is wrong by itself, and what only fits together."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from slip_detector.parameters.fields import converted
from slip_detector.parameters.sets import ConfigType, ParameterSet

#: Time, in seconds, for which parameters that do not fit yet wait for those that they need. A
#: running node looks for requests every tenth of a second; on a busy machine the next one of the
#: same client came after up to a quarter.
WAIT_S = 0.5


def changed(config: ConfigType, values: Mapping[str, Any]) -> ConfigType:
    """Return a configuration with some parameters changed, by flat names; None deletes a group.

    Raises
    ------
    ValueError
        For an unknown name, values that are not allowed, or a parameter that cannot be deleted.

    Examples
    --------
    >>> from slip_detector.parameters import ChainConfig
    >>> groups = {'groups.a': [2], 'groups.all': None}
    >>> changed(ChainConfig(channels=2), {'disabled_channels': [1], **groups}).groups
    {'a': (2,)}
    """
    for name, value in values.items():
        if value is None and not name.startswith('groups.'):
            raise ValueError(f'parameter {name} cannot be deleted, allowed: groups.<name>')
    given = {**config.to_parameters(), **values}
    return type(config).from_parameters({n: v for n, v in given.items() if v is not None})


class Judge:
    """Judges parameters together that come one after the other, as a file is loaded.

    What is wrong whatever the others are is refused alone. All else of a request is taken or
    refused as a set. A set that is refused waits for ``WAIT_S``: it is taken together with a later
    request that makes it possible. As a file cannot delete groups, those of a set replace all
    others where they do not fit beside them.

    Parameters
    ----------
    check
        Raises a ValueError when a configuration, though valid, cannot be run.
    """

    def __init__(self, check: Callable[[Any], None]) -> None:
        self._check = check
        self._waiting: dict[str, Any] = {}
        self._until_s = -math.inf

    def judged(
        self, config: ParameterSet, given: Sequence[tuple[str, Any]], now_s: float
    ) -> tuple[dict[str, Any], list[str]]:
        """Return the values to set, and for each of those given why it is refused, or ``''``.

        Parameters
        ----------
        config
            The present configuration.
        given
            Names and values of a request, in its order; of a name given twice the last value that
            is not refused counts.
        now_s
            A steady clock.

        Examples
        --------
        >>> from slip_detector.parameters import ChainConfig
        >>> judge, config = Judge(lambda config: None), ChainConfig()
        >>> judge.judged(config, [('decision', 'evidence'), ('gain', 0.0)], now_s=5.0)[1]
        ['parameter noise_floor has 0 numbers, allowed: one number, or 16, one for each channel \
(not yet: it waits 0.5 s for others)', 'parameter gain is 0, allowed: 1e-06 to 1e+06']
        >>> judge.judged(config, [('noise_floor', [0.1])], now_s=5.2)
        ({'decision': 'evidence', 'noise_floor': [0.1]}, [''])
        """
        refusals = [_wrong_alone(config, *each) for each in given]
        together = dict(each for each, refusal in zip(given, refusals, strict=True) if not refusal)
        waited = self._waiting if now_s < self._until_s else {}
        self._waiting, self._until_s = {**waited, **together}, now_s + WAIT_S
        old = {name: None for name in config.to_parameters() if name.startswith('groups.')}
        refusal = ''
        for values in ({**waited, **together}, together):
            others = old if any(name.startswith('groups.') for name in values) else {}
            for whole in (values, {**others, **values}):
                try:
                    self._check(changed(config, whole))
                except ValueError as error:
                    if whole == together:
                        refusal = f'{error} (not yet: it waits {WAIT_S:g} s for others)'
                else:
                    self._waiting = {n: value for n, value in waited.items() if n not in whole}
                    return whole, refusals
        return {}, [alone or refusal for alone in refusals]


def _wrong_alone(config: ParameterSet, name: str, value: Any) -> str:
    """Return why a value is refused beside any others; empty if others may make it possible."""
    fields, group = config.__dataclass_fields__, name.removeprefix('groups.')
    try:
        if name in fields and value is not None:
            converted(value, fields[name], f'parameter {name}')
        elif name == group:  # It is unknown, or cannot be deleted.
            changed(config, {name: value})
        elif value is not None:
            converted({group: value}, fields['groups'], 'parameter groups')
    except ValueError as error:
        return str(error)
    return ''
