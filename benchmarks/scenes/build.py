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
