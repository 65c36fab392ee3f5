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

"""The progress bar of a command."""

import sys
from typing import Any

from tqdm import tqdm


def progress_bar(total: int, unit: str, done: int = 0) -> 'tqdm[Any]':
    """Return a progress bar on stderr; it is disabled where stderr is not a terminal.

    Parameters
    ----------
    total, done
        Number of all steps, and of those that are done.
    unit
        Name of a step, for example ``trial``.

    Examples
    --------
    >>> with progress_bar(total=200, unit='trial', done=50) as bar:
    ...     bar.n
    50
    """
    bar: tqdm[Any] = tqdm(
        total=total, initial=done, unit=unit, disable=not sys.stderr.isatty(), file=sys.stderr,
        dynamic_ncols=True, mininterval=0.0,
    )  # fmt: skip
    return bar
