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

"""Changes of parameters in use: several at once, taken or refused together."""

from collections.abc import Callable, Mapping
from typing import Any

from slip_detector.parameters.sets import ConfigType


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
    given = config.to_parameters()
    for name, value in values.items():
        if value is not None or name not in given:
            given[name] = [] if value is None else value
        elif name.startswith('groups.'):
            del given[name]
        else:
            raise ValueError(f'parameter {name} cannot be deleted, allowed: groups.<name>')
    return type(config).from_parameters(given)


def fitting(
    config: ConfigType, values: Mapping[str, Any], check: Callable[[ConfigType], None]
) -> Mapping[str, Any]:
    """Return the values to set together: those given, or with them None for each other group.

    A parameter file cannot delete groups. Therefore the groups that it gives replace all others
    where they do not fit beside them.

    Parameters
    ----------
    config
        The present configuration.
    values
        New values, by flat names.
    check
        Raises a ValueError when a configuration, though valid, cannot be run.

    Raises
    ------
    ValueError
        When the values are not allowed, or do not fit to the present ones.

    Examples
    --------
    >>> from slip_detector.parameters import ChainConfig
    >>> file = {'channels': 2, 'groups.all': [1, 2]}
    >>> fitting(ChainConfig(channels=3, groups={'old': [1, 2, 3]}), file, lambda config: None)
    {'groups.old': None, 'channels': 2, 'groups.all': [1, 2]}
    """
    try:
        check(changed(config, values))
    except ValueError:
        if not any(name.startswith('groups.') for name in values):
            raise
        old = {name: None for name in config.to_parameters() if name.startswith('groups.')}
        values = {**old, **values}
        check(changed(config, values))
    return values
