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

"""Reads the numbers that a field path like ``pillars[].fz`` selects in messages.

A message is any object with the fields as attributes, such as one of rclpy or of rosbags.
"""

import dataclasses
import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.fields import listed

Floats = NDArray[np.float64]

#: Labels of the two dimensions of a ``*MultiArray`` that carries several samples.
BATCH_LABELS = ['sample', 'channel']

_STEP = re.compile(r'(?P<name>[A-Za-z]\w*)(?P<index>\[\d{0,9}\])?', re.ASCII)
_SYNTAX = 'names joined by dots, each perhaps with [] (all elements) or [2] (the third)'


class _PathStep(NamedTuple):
    """One part of a path.

    Attributes
    ----------
    name : str
        Name of the field.
    element : int, '' or None
        Index in a list; '' for all elements; None for the field itself.
    """

    name: str
    element: 'int | str | None'


class FieldReader:
    """Reads the numbers of one field out of messages.

    Parameters
    ----------
    path
        Names joined by dots, such as ``position`` or ``wrench.force.x``. ``[]`` means all
        elements of a list, as in ``pillars[].fz``, and ``[0]`` the first, as in
        ``tactiles[0].pressure``.

    Raises
    ------
    ValueError
        When the text is not such a path.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from slip_detector.recordings.field_paths import FieldReader
    >>> @dataclass
    ... class Pillar:
    ...     fz: float
    >>> @dataclass
    ... class Array:
    ...     pillars: list[Pillar]
    >>> FieldReader('pillars[].fz')(Array([Pillar(0.5), Pillar(0.25)]))
    array([[0.5 , 0.25]])
    """

    def __init__(self, path: str) -> None:
        self.path = path
        self._steps = [_step(part, path) for part in path.split('.')]
        # A path of a single name has a faster way to read messages of one sample.
        self._only = path if len(self._steps) == 1 and self._steps[0].element is None else ''

    def __call__(self, message: Any) -> Floats:
        """Return the numbers of the field.

        Parameters
        ----------
        message
            Any object that has the message's fields as attributes.

        Returns
        -------
        ndarray, shape (samples, channels)
            One row; several for the ``data`` of a ``*MultiArray`` whose layout has the two
            dimensions ``sample`` and ``channel``.

        Raises
        ------
        ValueError
            When there is no such field or it holds no numbers; names the existing fields.
        """
        if self._only and not hasattr(message, 'layout'):
            value = getattr(message, self._only, None)
            if isinstance(value, np.ndarray) or hasattr(value, 'typecode'):
                with np.errstate(invalid='ignore'):  # a signalling NaN warns
                    return np.array(value, dtype=np.float64, ndmin=2)
        values: list[Any] = []
        self._collect(message, 0, type(message).__name__.rsplit('__', 1)[-1], values)
        rows = values[0] if len(values) == 1 else np.concatenate(values)
        return np.asarray(rows.reshape(1, -1) if rows.ndim == 1 else rows)

    def _collect(self, message: Any, k: int, where: str, values: list[Any]) -> None:
        """Append the numbers that the path, from its k-th step on, selects in a message."""
        step = self._steps[k]
        known = field_names(message)
        if step.name not in known:
            raise ValueError(
                f'field {self.path}: {where} has no {step.name}, there are: ' + listed(known)
            )
        value = getattr(message, step.name)
        where = step.name if k == 0 else f'{where}.{step.name}'
        if k + 1 == len(self._steps) and step.element is None:
            values.append(self._numbers(value, where))
            if step.name == 'data' and hasattr(message, 'layout'):
                values[-1] = self._as_laid_out(values[-1], message.layout)
            return
        for name, element in self._elements(value, step.element, where):
            if k + 1 < len(self._steps):
                self._collect(element, k + 1, name, values)
            else:
                values.append(self._numbers(element, name))
        if not values:
            raise ValueError(f'field {self.path}: {where} is empty, allowed: at least one element')

    def _elements(self, value: Any, index: 'int | str | None', where: str) -> list[Any]:
        """Return names and values of the elements that an index selects."""
        if index is None:
            if field_names(value):
                return [(where, value)]
            listed = hasattr(value, '__len__') and not isinstance(value, str)
            hint = f'{where}[] or {where}[0]' if listed else 'the path to end here'
            raise ValueError(f'field {self.path}: {where} is no message, allowed: {hint}')
        if isinstance(value, (str, bytes)) or not hasattr(value, '__len__'):
            raise ValueError(f'field {self.path}: {where} is no list, allowed: {where} without []')
        if index == '':
            return [(f'{where}[{i}]', element) for i, element in enumerate(value)]
        if int(index) >= len(value):
            raise ValueError(
                f'field {self.path}: {where} has {len(value)} elements, allowed: below that'
            )
        return [(f'{where}[{index}]', value[int(index)])]

    def _numbers(self, value: Any, where: str) -> Floats:
        """Return the numbers at the end of a path."""
        inner = field_names(value)
        if inner:
            raise ValueError(
                f'field {self.path}: {where} is a message, allowed: one of its fields: '
                + listed([f'{where}.{name}' for name in inner])
            )
        if isinstance(value, (str, bytes)):
            raise ValueError(f'field {self.path}: {where} is text, allowed: numbers')
        # NumPy reads the arrays of rclpy (array.array) through their buffer.
        array = np.asarray(value)
        if array.dtype.kind not in 'fiub':
            names = field_names(value[0]) if len(value) else []
            hint = f'numbers, such as {where}[].{names[0]}' if names else 'numbers'
            raise ValueError(f'field {self.path}: {where} is no list of numbers, allowed: {hint}')
        with np.errstate(invalid='ignore'):  # a signalling NaN warns
            return array.astype(np.float64).reshape(-1)

    def _as_laid_out(self, values: Floats, layout: Any) -> Floats:
        """Return the samples of a batch as rows."""
        if [dimension.label for dimension in layout.dim] != BATCH_LABELS:
            return values
        samples, channels = (int(dimension.size) for dimension in layout.dim)
        begin = int(layout.data_offset)
        if begin + samples * channels != len(values):
            raise ValueError(
                f'field {self.path}: has {len(values)} numbers, allowed: {samples} x {channels}, '
                'as the layout says'
            )
        return values[begin:].reshape(samples, channels)


def _step(part: str, path: str) -> _PathStep:
    match = _STEP.fullmatch(part)
    if not match:
        raise ValueError(f'field {path!r} has the part {part!r}, allowed: {_SYNTAX}')
    index = match['index']
    inner = None if index is None else index[1:-1]
    return _PathStep(match['name'], int(inner) if inner else inner)


def field_names(message: Any) -> list[str]:
    """Return the names of a message's fields in order; empty for other objects.

    Examples
    --------
    >>> @dataclasses.dataclass
    ... class Vector:
    ...     x: float
    ...     y: float
    >>> field_names(Vector(1.0, 2.0)), field_names(3.0)
    (['x', 'y'], [])
    """
    if hasattr(message, 'get_fields_and_field_types'):  # a message of rclpy
        return list(message.get_fields_and_field_types())
    if dataclasses.is_dataclass(message):
        # The message classes of rosbags have the name of the type as a further field.
        names = [field.name for field in dataclasses.fields(message)]
        return [name for name in names if not name.startswith('__')]
    return []
