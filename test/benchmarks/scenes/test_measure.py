"""What is measured of the scenes."""

import pytest

from benchmarks.scenes.measure import measure_scenes


def test_an_unknown_scene_is_named():
    with pytest.raises(ValueError, match="no scene 'moon', allowed: "):
        measure_scenes(quick=True, names=('moon',))
