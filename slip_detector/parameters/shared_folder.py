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

"""The folder with the files that come with the package: configurations and scenes."""

from pathlib import Path


def shared_folder() -> Path:
    """Return the folder that holds ``config``: the source tree's or the installed package's.

    Raises
    ------
    ValueError
        When the package was installed without it.

    Examples
    --------
    >>> (shared_folder() / 'config' / 'slip_detector.yaml').is_file()
    True
    """
    for parent in Path(__file__).resolve().parents:
        for folder in (parent, parent / 'share' / 'slip_detector'):
            if (folder / 'config' / 'scenes').is_dir() and (folder / 'package.xml').is_file():
                return folder
    raise ValueError('the package was installed without its config folder: install it again')
