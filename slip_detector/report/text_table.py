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

"""Tables of plain text, as the commands print them."""

from collections.abc import Sequence

#: The text of a figure that is not defined.
UNDEFINED = '-'


def text_table(rows: Sequence[Sequence[str]], alignment: str = '<>', indent: int = 2) -> str:
    """Return rows of text as a table whose columns are two spaces apart.

    Parameters
    ----------
    rows
        Rows with the same number of cells.
    alignment
        One character for each column: ``<`` aligns its cells to the left, ``>`` to the right. The
        last character applies to all further columns too.
    indent
        Spaces before the first column.

    Returns
    -------
    str
        A line for each row, without spaces at its end.

    Raises
    ------
    ValueError
        When the rows differ in length.

    Examples
    --------
    >>> print(text_table([('plate', 'delay [ms]'), ('400 um', '38.98'), ('all', '-')], indent=0))
    plate   delay [ms]
    400 um       38.98
    all              -
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = alignment.ljust(len(widths), alignment[-1])
    return '\n'.join(
        (
            ' ' * indent
            + '  '.join(
                f'{cell:{side}{width}}'
                for cell, side, width in zip(row, sides, widths, strict=False)
            )
        ).rstrip()
        for row in rows
    )


def number_text(value: float | None, form: str) -> str:
    """Return a figure in one of Python's formats; a dash where it is not defined.

    Examples
    --------
    >>> number_text(38.9777, '.2f'), number_text(None, '.2f')
    ('38.98', '-')
    """
    return UNDEFINED if value is None else format(value, form)
