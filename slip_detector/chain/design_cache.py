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

"""Cache of filter designs on disk, so that a start does not wait for SciPy's signal package.

Loading that package takes longer than loading everything else that a chain needs.
"""

import contextlib
import hashlib
import os
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from slip_detector.parameters.files import whole_file, writable_folder

Array = NDArray[np.float64]

#: Folder of the designs, in the user's cache (XDG base directory specification).
FOLDER = Path(os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache')) / 'slip_detector'


def load_or_make(key: tuple[object, ...], design: Callable[[], Array]) -> Array:
    """Return a design from disk, or make it and write it to disk.

    If the signal package is loaded already, nothing is read or written: there is no time to save,
    and a search over thousands of filters leaves no files.

    Parameters
    ----------
    key
        Everything that the design depends on, as values whose ``repr`` is exact.
    design
        Makes the design.

    Returns
    -------
    ndarray, shape (sections, 6)
        The same bits as ``design`` returns with the same versions of SciPy and NumPy.

    Examples
    --------
    >>> import scipy.signal
    >>> design = lambda: scipy.signal.butter(2, [7.0, 50.0], 'bandpass', fs=380.0, output='sos')
    >>> load_or_make(('an example', 7.0, 50.0, 380.0), design).shape
    (2, 6)
    """
    if 'scipy.signal' in sys.modules:
        return design()
    path = FOLDER / f'design-{_name(key)}.npy'
    # A missing or damaged file is replaced below.
    with contextlib.suppress(OSError, ValueError, EOFError):
        sections: Array = np.load(path)
        if sections.ndim == 2 and sections.shape[1] == 6 and sections.dtype == np.float64:
            return sections
    sections = design()
    # Without the file the next start only takes longer.
    with contextlib.suppress(ValueError), whole_file(writable_folder(FOLDER) / path.name) as new:
        np.save(new, sections)
    return sections


def _name(key: tuple[object, ...]) -> str:
    """Return a name that depends on the key, the versions of the libraries and our design code."""
    source = zlib.crc32(Path(__file__).with_name('filters.py').read_bytes())
    everything = repr((scipy.__version__, np.__version__, source, key))
    return hashlib.sha256(everything.encode()).hexdigest()[:32]
