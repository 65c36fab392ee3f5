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

"""The parameters of a running detector, as pages show and change them.

A page sends text that was typed, or numbers from a line that was dragged in a plot. The detector
decides whether a value is allowed; its message is shown.
"""

import contextlib
import dataclasses
import re
from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple, get_args

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.fields import allowed, default_of, shortened, under_headings

#: Heading of the parameters that do not belong to this package.
OF_ROS = 'Of every node'

#: How many changes can be undone.
MOST_CHANGES = 1000

#: How many changes a page lists.
LATELY = 8

#: Authors of changes that no page asked for: another program, or a restart of the detector.
OUTSIDE, RESTART = 'outside', 'restart'

_FIELDS = {field.name: field for field in dataclasses.fields(DetectorConfig)}
_HEADINGS = {
    field.name: heading
    for heading, fields in under_headings(DetectorConfig).items()
    for field in fields
}


class Reading(NamedTuple):
    """The answer of a detector that is asked for its parameters.

    Attributes
    ----------
    values : dict
        Values in the form that ROS uses, by name.
    read_only : frozenset of str
        Names of those that cannot change while the node runs.
    meanings : dict
        Descriptions, by name.

    Examples
    --------
    >>> Reading({'threshold': 0.5}, frozenset(), {'threshold': 'Level of a channel'}).values
    {'threshold': 0.5}
    """

    values: dict[str, Any]
    read_only: frozenset[str]
    meanings: dict[str, str]


class Change(NamedTuple):
    """A set of parameters that changed at once.

    Attributes
    ----------
    before, after : dict
        Values by name; None: the parameter does not exist.
    by : str
        The page, or ``OUTSIDE``, or ``RESTART``.

    Examples
    --------
    >>> Change({'threshold': 0.5}, {'threshold': 0.7}, by='this page').after
    {'threshold': 0.7}
    """

    before: dict[str, Any]
    after: dict[str, Any]
    by: str


class ParameterPanel:
    """The parameters of one detector, their changes, and the values of its file.

    Parameters
    ----------
    file_values
        The values of the parameter file; None: there is none, and the first values read are used.

    Attributes
    ----------
    values : dict
        The present values; empty until they are read.
    file_values : dict or None
        As above.
    history : deque of Change
        Changes that can be undone, the newest last.
    changes : deque of Change
        The latest changes, undone or not, the newest last.
    count : int
        Number of changes so far.
    version : int
        Increases whenever something that a page shows has changed.

    Examples
    --------
    >>> panel = ParameterPanel()
    >>> _ = panel.read(Reading({'threshold': 0.5, 'gain': 1.0}, frozenset(), {}))
    >>> panel.expect({'threshold': 0.25}, 'page 1')
    >>> panel.update({'threshold': 0.25}).by
    'page 1'
    >>> panel.to_undo(), panel.as_in_file()
    ({'threshold': 0.5}, {'threshold': 0.5})
    """

    def __init__(self, file_values: Mapping[str, Any] | None = None) -> None:
        self.values: dict[str, Any] = {}
        self.history: deque[Change] = deque(maxlen=MOST_CHANGES)
        self.changes: deque[Change] = deque(maxlen=LATELY)
        self.count = self.version = 0
        self._expected: deque[tuple[dict[str, Any], str]] = deque(maxlen=MOST_CHANGES)
        self.file_values = None if file_values is None else dict(file_values)
        self._read_only: frozenset[str] = frozenset()
        self._meanings: dict[str, str] = {}

    def read(self, reading: Reading) -> Change | None:
        """Take the detector's answer; return the change since the last answer, if any.

        A detector that was started again has the values of its file. This counts as a change:
        undoing it restores what had been set before the restart.
        """
        known = bool(self.values)
        self.version += 1
        self._read_only, self._meanings = reading.read_only, reading.meanings
        if known:
            self._expected.clear()
            gone = dict.fromkeys(self.values.keys() - reading.values.keys())
            return self._update({**gone, **reading.values}, RESTART)
        self.values = dict(reading.values)
        if self.file_values is None:
            self.file_values = dict(reading.values)
        return None

    def expect(self, values: Mapping[str, Any], by: str) -> None:
        """Note that a page asks for a change, so that the change is attributed to it."""
        self._expected.append((dict(values), by))

    def refused(self, values: Mapping[str, Any], by: str) -> None:
        """Drop an expected change, which the detector has refused."""
        with contextlib.suppress(ValueError):
            self._expected.remove((dict(values), by))

    def update(self, values: Mapping[str, Any]) -> Change | None:
        """Note values that the detector reports; return the change, None if there is none.

        Parameters
        ----------
        values
            By name; None: the parameter was deleted.
        """
        # The report is the event of one change, or has all parameters when they are read.
        given = values.keys()
        changed = {name for name in given if self.values.get(name) != values[name]}
        asked = [
            each
            for each in self._expected
            if each[0].keys() == given or (changed and changed <= each[0].keys() < given)
        ]
        if not asked:
            return self._update(values, OUTSIDE)
        # Two pages may have asked for the same parameters at once: equal values tell which one.
        # If none are equal, the detector has rounded them.
        equal = (each for each in asked if each[0].items() <= values.items())
        found = next(equal, asked[0])
        # No report will come of earlier requests for the same parameters: they were overtaken.
        for each in asked[: asked.index(found) + 1]:
            self._expected.remove(each)
        return self._update(values, found[1])

    def _update(self, values: Mapping[str, Any], by: str) -> Change | None:
        after = {name: value for name, value in values.items() if self.values.get(name) != value}
        if not after:
            return None
        change = Change({name: self.values.get(name) for name in after}, after, by)
        self.changes.append(change)
        self.count += 1
        self.version += 1
        merged = {**self.values, **after}
        self.values = {name: value for name, value in merged.items() if value is not None}
        kept = Change(self._settable(change.before), self._settable(after), by)
        if by != RESTART and self.history and self.history[-1].before == kept.after:
            self.history.pop()
        elif kept.after:
            self.history.append(kept)
        return change

    @property
    def config(self) -> DetectorConfig:
        """The present values as a configuration."""
        ours = {n: v for n, v in self.values.items() if n.partition('.')[0] in _FIELDS}
        return DetectorConfig.from_parameters(ours)

    def to_undo(self) -> dict[str, Any]:
        """Return the values that undo the last change; empty where there is none."""
        return dict(self.history[-1].before) if self.history else {}

    def as_in_file(self) -> dict[str, Any]:
        """Return the values that restore those of the file; empty if nothing differs."""
        wanted = self.file_values or {}
        groups = [name for name in self.values if name.startswith('groups.')]
        values = {**dict.fromkeys(groups), **wanted}
        return self._settable(
            {name: value for name, value in values.items() if self.values.get(name) != value}
        )

    def _settable(self, values: Mapping[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in values.items() if name not in self._read_only}

    def shown(self) -> list[dict[str, Any]]:
        """Return what a page shows: headings, each with its parameters in order."""
        parts: dict[str, list[dict[str, Any]]] = {}
        for field, heading in _HEADINGS.items():
            rows = [self._row(n) for n in self.values if n.partition('.')[0] == field]
            parts.setdefault(heading, []).extend(rows)
        parts[OF_ROS] = [self._row(n) for n in self.values if n.partition('.')[0] not in _FIELDS]
        return [{'heading': each, 'parameters': rows} for each, rows in parts.items() if rows]

    def _row(self, name: str) -> dict[str, Any]:
        field = _FIELDS.get(name.partition('.')[0])
        value, in_file = self.values[name], (self.file_values or {}).get(name)
        unit = field.metadata['unit'] if field else ''
        choices = field.metadata['choices'] if field else ()
        return {
            'name': name,
            'value': value,
            'text': text_of(value),
            'in_file': None if in_file is None else text_of(in_file),
            'unit': unit,
            'meaning': field.metadata['meaning'] if field else self._meanings.get(name, ''),
            'allowed': allowed(field).removesuffix(f' {unit}') if field else '',
            'choices': ['true', 'false'] if isinstance(value, bool) else list(choices),
            'read_only': name in self._read_only,
        }


def words_of(change: Change) -> str:
    """Return a change in words, without its author.

    Examples
    --------
    >>> words_of(Change({'gain': 1.0, 'groups.a': None}, {'gain': 9.5, 'groups.a': [1]}, ''))
    'gain from 1 to 9.5, groups.a from nothing to 1'
    """

    def shown(value: Any) -> str:
        return 'nothing' if value is None else text_of(value) or 'empty'

    return ', '.join(
        f'{name} from {shortened(shown(change.before[name]))} to {shortened(shown(value))}'
        for name, value in change.after.items()
    )


def text_of(value: Any) -> str:
    """Return a value as a user types it: a list without brackets.

    Examples
    --------
    >>> text_of([7.0, 50.0]), text_of(True), text_of(0.1)
    ('7, 50', 'true', '0.1')
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(value).removesuffix('.0')
    if isinstance(value, (list, tuple)):
        return ', '.join(map(text_of, value))
    return str(value)


def typed(name: str, text: str) -> Any:
    """Return the value of text typed for a parameter; the detector decides if it is allowed.

    Examples
    --------
    >>> typed('stopbands_hz', '[0.5, 7], [50, 180]'), typed('vote', ' 2'), typed('vote', 'all')
    ([0.5, 7, 50, 180], 2, 'all')
    >>> typed('threshold', 'low')
    'low'
    """
    text = text.strip()
    field = _FIELDS.get(name.partition('.')[0])
    default = default_of(field) if field else None
    if field and isinstance(default, (tuple, dict)):
        items = re.sub(r'[\[\]()]', ' ', text).split(',') if text.strip('[] ') else []
        is_text = isinstance(default, tuple) and str in get_args(field.type)
        return [item.strip() if is_text else _scalar(item.strip()) for item in items]
    if isinstance(default, str) and name != 'vote':
        return text
    return _scalar(text)


def _scalar(text: str) -> Any:
    if text in ('true', 'false'):
        return text == 'true'
    if re.fullmatch('[-+]?[0-9]+', text):
        return int(text)
    try:
        return float(text) if re.fullmatch('[-+.0-9eE]+', text) else text
    except ValueError:
        return text
