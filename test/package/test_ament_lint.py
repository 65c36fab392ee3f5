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

"""The linters of ROS 2; with ``colcon test`` they come with the package's dependencies."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ('slip_detector', 'benchmarks', 'examples', 'launch', 'test')
SOURCES = [str(ROOT / name) for name in (*FOLDERS, 'setup.py')]

#: How a comment begins, by the ending of a source.
MARKS = {'.py': '#', '.c': '//', '.cpp': '//'}

#: What of PEP 257 does not fit to numpydoc, with Ruff checking the rest in its own words: where a
#: summary stands (213), an empty line at the end (413), properties that say what they are (401),
#: and parameters whose names are those of sections, `notes` and `parameters`.
NUMPYDOC = ('D213', 'D401', 'D402', 'D405', 'D407', 'D410', 'D411', 'D413', 'D414', 'D417')


def test_each_source_begins_with_copyright_and_license():
    header = (ROOT / 'setup.py').read_text().split('\n\n')[0]
    assert re.match(r'# Copyright \d{4} The slip_detector maintainers\n#\n# Licensed', header)
    files = [path for folder in FOLDERS for path in (ROOT / folder).rglob('*.*')]
    sources = [path for path in files if path.suffix in MARKS]
    assert len(sources) > 100
    for path in sources:
        text = path.read_text(encoding='utf-8')
        assert not text or text.startswith(header.replace('#', MARKS[path.suffix])), (
            f'{path}: run ament_copyright --add-missing, as CONTRIBUTING.md says'
        )


@pytest.mark.parametrize(
    ('name', 'words'),
    [
        ('copyright', [str(ROOT / 'LICENSE'), str(ROOT / 'CONTRIBUTING.md')]),
        ('flake8', ['--config', str(Path(__file__).parent / 'ament_flake8.ini')]),
        ('pep257', ['--add-ignore', *NUMPYDOC, '--']),
    ],
)
def test_a_linter_of_ros_finds_nothing(name, words):
    reason = 'needs the ament linters, which come with a ROS 2 installation'
    linter = pytest.importorskip(f'ament_{name}.main', reason=reason)
    assert linter.main([*words, *SOURCES]) == 0
