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

"""Finds scene files by name, and builds their scenes."""

from pathlib import Path

import numpy as np

from slip_detector.parameters.conversion import shown
from slip_detector.parameters.shared_folder import shared_folder
from slip_detector.parameters.yaml_files import read_yaml
from slip_detector.scenes.scene import Scene


def load_scene(path: str | Path, trial: np.random.Generator) -> Scene:
    """Build the scene that a YAML file describes.

    Parameters
    ----------
    path
        The file.
    trial
        Generator of everything that differs from trial to trial.

    Raises
    ------
    ValueError
        When the file cannot be read or does not describe a scene; names the file.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes import find_scene, load_scene
    >>> scene = load_scene(find_scene('plate_400um'), np.random.default_rng(0))
    >>> samples = scene.read(380)
    >>> samples.volts.shape, bool(samples.truth.any())
    ((380, 16), False)
    """
    try:
        return Scene(read_yaml(path), trial)
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith(str(path)) else f'{path}: {text}') from None


def find_scene(name: str) -> Path:
    """Return the path of a scene file.

    Parameters
    ----------
    name
        Name of a scene of the package, or a path that ends in .yaml or .yml.

    Raises
    ------
    ValueError
        When the package has no scene of this name; lists the names.

    Examples
    --------
    >>> from slip_detector.scenes import find_scene
    >>> find_scene('taps').name, find_scene('my/own.yaml').name
    ('taps.yaml', 'own.yaml')
    """
    path = Path(name)
    if path.suffix in ('.yaml', '.yml'):
        return path
    folder = shared_folder() / 'config' / 'scenes'
    known = sorted(file.stem for file in folder.glob('*.yaml'))
    if name not in known:
        raise ValueError(
            f'no scene {shown(name)}, allowed: {", ".join(known)}, or a path to a .yaml'
        )
    return folder / f'{name}.yaml'
