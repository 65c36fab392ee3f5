"""Scenes as the measurements need them: built again and again, each time the same."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from slip_detector.scenes import Scene


def build_scene(description: Mapping[str, Any], **more: Any) -> Scene:
    """Build a scene at its beginning; all have the same seed.

    Parameters
    ----------
    description
        As in a scene's file.
    **more
        Parts or settings that take the place of those in the description.

    Examples
    --------
    >>> scene = build_scene({'steps': [{'duration_s': 0.1}]}, sample_rate_hz=1000.0)
    >>> scene.length
    100
    """
    return Scene({**description, **more}, np.random.default_rng(0))
