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

"""The files of the live page, as they are sent to a browser."""

from importlib import resources
from typing import Any, NamedTuple

TYPES = {
    '.html': 'text/html; charset=utf-8',
    '.js': 'text/javascript; charset=utf-8',
    '.css': 'text/css; charset=utf-8',
    '.txt': 'text/plain; charset=utf-8',
    '.svg': 'image/svg+xml',
}


class PageFile(NamedTuple):
    """A file and its media type.

    Examples
    --------
    >>> page_files()['/page/live.css'].media_type
    'text/css; charset=utf-8'
    """

    content: bytes
    media_type: str


def page_files() -> dict[str, PageFile]:
    """Return all files that a browser may request, by path.

    ``/page`` has the files of the live page, ``/drawing`` those that it shares with the report.

    Examples
    --------
    >>> files = page_files()
    >>> files['/page/live.css'].media_type, '/drawing/uplot/uPlot.iife.min.js' in files
    ('text/css; charset=utf-8', True)
    """
    files: dict[str, PageFile] = {}
    for path, room, folder in (
        ('/page', 'slip_detector.view', 'page'),
        ('/drawing', 'slip_detector.report', 'templates'),
    ):
        _collect(path, resources.files(room) / folder, files)
    return files


def _collect(path: str, folder: Any, files: dict[str, PageFile]) -> None:
    for item in folder.iterdir():
        name = f'{path}/{item.name}'
        if item.is_dir():
            _collect(name, item, files)
        else:
            ending = '.' + item.name.rpartition('.')[2]
            if ending in TYPES:
                files[name] = PageFile(item.read_bytes(), TYPES[ending])
