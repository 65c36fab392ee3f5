"""Tables of plain text, as the commands print them."""

from collections.abc import Sequence

#: Stands where a figure is not defined.
UNDEFINED = '-'


def text_table(rows: Sequence[Sequence[str]], alignment: str = '<>', indent: int = 2) -> str:
    """Lay rows of text out in columns that are two spaces apart.

    Parameters
    ----------
    rows
        Each with as many cells as the others.
    alignment
        ``<`` for a column whose cells stand to the left, ``>`` for one whose cells stand to the
        right, column after column; the last also holds for all columns that follow.
    indent
        Spaces before the first column.

    Returns
    -------
    str
        One line a row, none of which ends with a space.

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
    """Write a figure in a format of Python's; a dash where it is not defined.

    Examples
    --------
    >>> number_text(38.9777, '.2f'), number_text(None, '.2f')
    ('38.98', '-')
    """
    return UNDEFINED if value is None else format(value, form)
