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

"""Files of pictures."""

import pytest
from matplotlib import pyplot as plt

from slip_detector.report.pictures import COLORS, save_picture, writable_picture


def test_the_colours_differ():
    assert len(set(COLORS)) == len(COLORS)


def test_a_picture_is_of_the_kind_that_its_ending_names_and_is_closed(tmp_path):
    for ending, begin in (('png', b'\x89PNG'), ('svg', b'<?xml'), ('pdf', b'%PDF')):
        figure, _ = plt.subplots()
        save_picture(figure, tmp_path / f'a.{ending}')
        assert (tmp_path / f'a.{ending}').read_bytes().startswith(begin)
        assert not plt.fignum_exists(figure.number)


def test_where_no_picture_can_be_written_is_said_before_it_is_drawn(tmp_path):
    assert writable_picture(tmp_path / 'new' / 'a.png') == tmp_path / 'new' / 'a.png'
    assert (tmp_path / 'new').is_dir()
    with pytest.raises(ValueError, match=r'has the ending \.txt, allowed: .*\.png'):
        writable_picture(tmp_path / 'a.txt')
    with pytest.raises(ValueError, match='cannot be written, allowed: a file in a folder'):
        writable_picture(tmp_path / 'new')
