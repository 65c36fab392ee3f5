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

"""The figures of the scenes as text."""

import json

from benchmarks.scenes.table import scenes_table


def test_the_table_has_all_and_fits(scenes_figures):
    text = scenes_table(scenes_figures)
    assert max(map(len, text.splitlines())) <= 99
    for word in ('plate: ', 'object: ', 'closed form', 'LSODA', 'Radau', 'front.ratio', 'met'):
        assert word in text


def test_the_result_is_json(scenes_figures):
    assert json.loads(json.dumps(scenes_figures, allow_nan=False))['precision'][0]['runs']
