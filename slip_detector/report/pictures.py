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

"""What all pictures share: how they are saved, and their colours."""

import os
from pathlib import Path

import matplotlib

matplotlib.use('Agg')  # Only files are written, as a robot has no screen.

from matplotlib import pyplot as plt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from slip_detector.parameters.files import whole_file

#: Colours that colour-blind readers can distinguish (Okabe and Ito): blue, vermilion, green,
#: purple, orange, sky blue, black.
COLORS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#000000')


def save_picture(figure: Figure, path: Path) -> None:
    """Write a figure to a file, in the format that the ending names, and close the figure.

    Raises
    ------
    ValueError
        When the file cannot be written; names it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_picture(Figure(figsize=(1, 1)), Path(folder) / 'empty.svg')
    ...     [path.name for path in Path(folder).iterdir()]
    ['empty.svg']
    """
    try:
        with whole_file(path) as new:
            figure.savefig(new, dpi=120)
    finally:
        plt.close(figure)


def writable_picture(name: str | Path) -> Path:
    """Return the path of a picture that is to be drawn later, and make its folder.

    Raises
    ------
    OSError
        When the folder cannot be made.
    ValueError
        When no picture can be written there.

    Examples
    --------
    >>> writable_picture('timeline.odp')
    Traceback (most recent call last):
    ValueError: timeline.odp: has the ending .odp, allowed: ...
    """
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        raise ValueError(f'{path}: cannot be written, allowed: a file in a folder of your own')
    kinds = sorted(FigureCanvasAgg.get_supported_filetypes())
    if path.suffix and path.suffix[1:].lower() not in kinds:
        raise ValueError(f'{path}: has the ending {path.suffix}, allowed: .{", .".join(kinds)}')
    return path
