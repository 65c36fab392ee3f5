"""Scenes for the measurements, which build the same scene many times."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from slip_detector.scenes import Scene


def build_scene(description: Mapping[str, Any], **more: Any) -> Scene:
    """Build a scene, always with the same seed.

    Parameters
    ----------
    description
        The content of a scene file.
    **more
        Parts or settings that replace those of the description.

    Examples
    --------
    >>> scene = build_scene({'steps': [{'duration_s': 0.1}]}, sample_rate_hz=1000.0)
    >>> scene.length
    100
    """
    return Scene({**description, **more}, np.random.default_rng(0))
