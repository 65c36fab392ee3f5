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

"""The chain on blocks of rows against its rivals."""

import numpy as np
import pytest

from benchmarks.chain import block_speed, cpp_chain
from benchmarks.chain.block_speed import LEAST_AGREEMENT, measure_blocks
from benchmarks.chain.cpp_chain import find_compiler
from benchmarks.chain.numpy_chain import NumpyChain


def test_the_rivals_decide_alike_on_data_with_both_decisions(chain_speed):
    agreement = chain_speed['blocks']['agreement']
    assert {'numpy', 'in_place'} <= set(agreement) <= {'numpy', 'in_place', 'cpp'}
    assert min(agreement.values()) >= LEAST_AGREEMENT
    assert 0.1 < chain_speed['blocks']['slip_share'] < 0.9


def test_ratios_are_those_of_the_times(chain_speed):
    part = chain_speed['blocks']
    ns = part['ns_per_row']
    in_pieces = ns['chain_in_pieces']
    assert all(time_ns > 0 for time_ns in ns.values())
    assert part['speedup'] == pytest.approx(ns['numpy'] / ns['chain'])
    assert part['in_place_speedup'] == pytest.approx(ns['in_place_in_pieces'] / in_pieces)
    assert part['kept_ratio'] == pytest.approx(ns['kept_in_pieces'] / in_pieces)
    assert part['whole_kept_ratio'] == pytest.approx(ns['kept'] / ns['chain'])
    assert part['median_ratio'] == pytest.approx(ns['median_in_pieces'] / in_pieces)
    assert part['evidence_ratio'] == pytest.approx(ns['evidence_in_pieces'] / in_pieces)
    if part['cpp_ratio'] is not None:
        assert part['cpp_ratio'] == pytest.approx(in_pieces / ns['cpp_in_pieces'])


def test_cpp_is_measured_where_there_is_a_compiler(chain_speed):
    part = chain_speed['blocks']
    assert (part['cpp_ratio'] is not None) is bool(find_compiler())
    assert bool(part['cpp_left_out']) is not bool(find_compiler())


def test_without_a_compiler_the_others_are_measured(monkeypatch):
    monkeypatch.setattr(cpp_chain.shutil, 'which', lambda name: None)
    part = measure_blocks(1000, rounds=1)
    assert part['cpp_ratio'] is None
    assert part['cpp_left_out'].startswith('there is no C++ compiler')
    assert part['speedup'] > 0


def test_a_chain_that_decides_otherwise_is_not_timed(monkeypatch):
    class Deaf(NumpyChain):
        def update(self, rows):
            return tuple(np.zeros_like(part) for part in super().update(rows))

    monkeypatch.setattr(block_speed, 'NumpyChain', Deaf)
    with pytest.raises(RuntimeError, match='decide differently'):
        measure_blocks(2000, rounds=1)
