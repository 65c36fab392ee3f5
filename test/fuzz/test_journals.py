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

"""Journals of studies, cut or changed anywhere."""

import json

import pytest

pytest.importorskip('optuna', reason='needs optuna')

import optuna

from slip_detector.tuning.study import Study
from support.fuzzing import fuzz
from support.mutations import mutated_bytes

DISTRIBUTIONS = {'x': optuna.distributions.FloatDistribution(0.0, 1.0)}

ENTRY = json.dumps({'op_code': 0, 'worker_id': 'w', 'study_name': 'a', 'directions': [1]}).encode()

CORPUS = [
    ENTRY + b'\n',
    ENTRY + b'\n' + ENTRY + b'\n{"op_code": 4, "wor',
    ENTRY,
    b'[1,2]\n',
    b'null\n',
    b'{"op_code": 99}\n',
    b'{"op_code": 4}\n',
    b'{"op_code": "x"}\n',
    b'[' * 50_000 + b'\n',
    b'\xff\n',
    b'',
]


def test_any_journal_goes_on_or_is_refused_in_one_line(tmp_path):
    path = tmp_path / 'some.journal'

    def study():
        return Study(str(path), 'a', DISTRIBUTIONS, seed=0)

    for x in (0.25, 0.5):
        whole = study()
        whole.tell(whole.ask({'x': x}), x, {'found': []})

    def check(data):
        path.write_bytes(data)
        goes_on = study()
        before = goes_on.follow()
        goes_on.tell(goes_on.ask({'x': 0.75}), 0.75, {})
        assert goes_on.follow() == before + 1
        assert study().lost == ''

    cases = mutated_bytes([path.read_bytes()])
    fuzz('journals', cases, check, corpus=CORPUS, few=30, refusal='^storage .*some[.]journal')
