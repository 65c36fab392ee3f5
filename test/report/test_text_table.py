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

"""Tables of plain text."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.report.text_table import number_text, text_table

CELL = st.text('ab 1.', max_size=8).map(str.strip)


@given(
    st.integers(1, 5).flatmap(
        lambda n: st.lists(st.lists(CELL, min_size=n, max_size=n), min_size=1)
    ),
    st.sampled_from(['<', '>', '<>', '><<']),
    st.integers(0, 3),
)
def test_each_cell_stands_in_its_column_on_its_side(rows, alignment, indent):
    lines = text_table(rows, alignment, indent).split('\n')
    assert len(lines) == len(rows)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for line, row in zip(lines, rows, strict=True):
        assert not line.endswith(' ')
        padded = line.ljust(indent + sum(widths) + 2 * len(widths))
        assert padded[:indent] == ' ' * indent
        at = indent
        for k, (cell, width) in enumerate(zip(row, widths, strict=True)):
            place = padded[at : at + width]
            side = alignment[min(k, len(alignment) - 1)]
            assert place == (cell.ljust(width) if side == '<' else cell.rjust(width))
            assert padded[at + width : at + width + 2] == '  '
            at += width + 2


def test_rows_of_different_lengths_are_refused():
    with pytest.raises(ValueError, match='zip'):
        text_table([('a', 'b'), ('c',)])


def test_a_figure_that_is_not_defined_is_a_dash():
    assert number_text(None, '.2f') == '-'
    assert number_text(0.0, '.2f') == '0.00'
    assert number_text(3, 'd') == '3'
