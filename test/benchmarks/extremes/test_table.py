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

"""The figures of the extremes as text."""

import json

from benchmarks.extremes.cases import Case, cases
from benchmarks.extremes.measure import measure_case, measure_long_run
from benchmarks.extremes.table import extremes_table


def test_the_table_fits_and_is_json():
    rows = [measure_case(case, with_reference=False) for case in cases() if case.method != 'live']
    done = Case('bristles', 'soft', {'friction': {'bristle_stiffness_n_m': 1e3}})
    rows.append(measure_case(done) | {'position_error_m': 1e-6})
    verdict = {'value': 0.0, 'bound': '<= 0', 'met': True}
    result = {'extremes': rows, 'hour': measure_long_run(8.0), 'wanted': {'hour.drift': verdict}}
    assert max(map(len, extremes_table(result).splitlines())) <= 99
    assert 'refused, see ' in extremes_table(result)
    assert 'friction: model is coulomb' in extremes_table(result)
    assert json.loads(json.dumps(result, allow_nan=False))
