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

"""The folder with the files that come with the package."""

import pytest

from slip_detector.parameters import shared_folder


def test_the_folder_has_the_configurations_and_scenes():
    folder = shared_folder.shared_folder()
    assert (folder / 'package.xml').is_file()
    assert (folder / 'config' / 'scenes' / 'plate_400um.yaml').is_file()


def test_a_package_without_its_folder_says_so(monkeypatch, tmp_path):
    monkeypatch.setattr(shared_folder, '__file__', str(tmp_path / 'shared_folder.py'))
    with pytest.raises(ValueError, match='without its config folder'):
        shared_folder.shared_folder()
