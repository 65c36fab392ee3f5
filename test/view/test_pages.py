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

"""The files that a browser gets."""

import re

from slip_detector.view.server import page_files


def test_all_that_the_page_asks_for_is_there():
    files = page_files()
    index = files['/page/index.html'].read_text(encoding='utf-8')
    wanted = set(re.findall(r'(?:href|src)="(/[^"]+)"', index))
    assert wanted
    for path in wanted:
        assert path in files
    modules = [path for path in files if path.startswith('/page/') and path.endswith('.js')]
    for path in modules:
        for name in re.findall(r"from '\./([^']+)'", files[path].read_text(encoding='utf-8')):
            assert f'/page/{name}' in files, path


def test_nothing_of_it_comes_from_elsewhere():
    for path, file in page_files().items():
        if path.startswith('/page/'):
            text = file.read_text(encoding='utf-8')
            places = set(re.findall(r'(?:https?:)?//[a-z][\w.-]*\.[a-z]+', text))
            # The name of the format, and that of the license in the head of each file.
            assert places <= {'http://www.w3.org', 'http://www.apache.org'}, path
