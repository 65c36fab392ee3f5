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

"""Error against run time, as pictures."""

import matplotlib.image
import pytest

from benchmarks.pictures import draw_chain_precision, draw_scenes_precision


@pytest.mark.parametrize(
    ('draw', 'measured'),
    [(draw_chain_precision, 'chain_precision'), (draw_scenes_precision, 'scenes_figures')],
)
def test_the_picture_has_lines_of_many_colours(draw, measured, tmp_path, request):
    draw(tmp_path / 'picture.png', request.getfixturevalue(measured))
    pixels = matplotlib.image.imread(tmp_path / 'picture.png')
    assert min(pixels.shape[:2]) > 300
    colours = {tuple(pixel) for pixel in pixels.reshape(-1, pixels.shape[-1])[::7]}
    assert len(colours) > 50
