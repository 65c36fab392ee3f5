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
