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

"""Parameter files, labels and scenes, as somebody's editor left them."""

from pathlib import Path

from fuzz.fuzzing import fuzz, mutated_text, put

from slip_detector.parameters.files import shared_folder
from slip_detector.parameters.yaml_files import read_yaml
from slip_detector.recordings.labels import read_labels
from support.config_cases import SETS

FILES = sorted((shared_folder() / 'config').glob('*.yaml'))
PIECES = [
    *('\n', ' ', '  ', ': ', '- ', '[', ']', '{', '}', '"', "'", '#', '&a ', '*a', '<<: *a\n'),
    *('!!python/object:os.system ', '!!binary ', '!!set ', '? ', '|', '>', '---\n', '...\n', '%'),
    *('~', 'null', 'yes', '1:30', '020', '0x1F', '1e3', '.nan', '.inf', '-', '2026-11-22', '\t'),
    *('\0', '\x85', '\ufeff', '٣', '/**', '/**/slip_driver', 'ros__parameters', 'threshold: 1\n'),
]


CORPUS = [
    # On one line, and on many, where PyYAML is a hundred times as fast.
    '[' * 500,
    '[\n' * 20_000,
    '/**/slip_detector: {ros__parameters: {threshold: 0.4, threshold: 0.5}}',
    '/**/slip_detector: {ros__parameters: {threshold: 1:30}}',
    '/**/slip_detector: {ros__parameters: {channels: 020}}',
    '/**/slip_detector: {ros__parameters: {vote: "٣"}}',
    '/**/slip_detector: {ros__parameters: {groups: {"": true}}}',
    '/**/slip_detector: {ros__parameters: {groups: [1], groups.new: [1]}}',
    'slip_driver: {source: serial}',
    'slip_s: [[1, 0]]',
    f'slip_s: []\naccuracy_s: {10**400}',
    '!!python/object/apply:os.system [true]',
    '? [a]\n: 1',
    '',
    Path('/dev/zero'),
]


def test_any_text_of_a_file_is_read_or_refused_in_one_line_that_names_the_file(tmp_path):
    file = tmp_path / 'some.yaml'
    readers = [*(config.from_yaml for config in SETS), read_labels, read_yaml]

    def check(text):
        # As bytes that are no text too.
        put(text if isinstance(text, Path) else text.encode('utf-8', 'surrogatepass'), file)
        refused = []
        for reader in readers:
            try:
                reader(file)
            except ValueError as error:
                refused.append(str(error))
        assert all(line.startswith(f'{file}') for line in refused), refused
        if len(refused) == len(readers):
            raise ValueError(refused[0])

    texts = [path.read_text(encoding='utf-8') for path in FILES]
    texts += ['slip_s: [[1.0, 2.5], [3.0, 4.0]]\naccuracy_s: 0.35\n', 'kind: press\n']
    fuzz(mutated_text(texts, PIECES), check, corpus=CORPUS, few=20, refusal='some.yaml')
