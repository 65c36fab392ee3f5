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

"""The search against one around SciPy and NumPy."""

import pytest

from benchmarks.tune.search_speed import (
    SAME_COST_MS,
    NumpyObjective,
    measure_search,
    slips_and_noise,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.tuning import TuneConfig
from slip_detector.tuning.objective import Objective


@pytest.mark.parametrize('exponent', [1, 3])
@pytest.mark.parametrize('common_mode', ['none', 'median'])
def test_the_rival_finds_what_the_search_finds(exponent, common_mode):
    track = slips_and_noise(0.3)
    chain = ChainConfig(exponent=exponent, common_mode=common_mode)
    sides = [
        kind([track], EvaluationConfig(), TuneConfig()).best(chain)
        for kind in (Objective, NumpyObjective)
    ]
    assert len(sides[0]) == 5
    for mine, its in zip(*sides, strict=True):
        assert mine.chain.vote == its.chain.vote
        assert mine.cost_ms == pytest.approx(its.cost_ms, abs=SAME_COST_MS)


def test_both_searches_try_the_same():
    result = measure_search(trials=3, minutes=0.2)
    assert result['agreement'] == 1.0
    assert result['speedup'] == result['numpy_s'] / result['search_s']
