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

"""The machine, and how it is named above the tables."""

import importlib.metadata

from benchmarks.measurement import heading, machine
from slip_detector.chain.compiled import COMPILED


def test_the_machine_is_described_with_the_versions_that_are_installed():
    facts = machine()
    assert facts['numpy'] == importlib.metadata.version('numpy')
    assert facts['scipy'] == importlib.metadata.version('scipy')
    assert facts['compiled'] is COMPILED
    assert (facts['numba'] is None) is not COMPILED
    assert facts['cores'] >= 1


def test_the_heading_names_the_machine_and_whether_it_was_quick():
    facts = machine() | {'cores': 77, 'numba': '0.0', 'compiled': True}
    text = heading({'machine': facts, 'quick': True})
    assert '77 cores' in text
    assert 'Numba 0.0' in text
    assert '--quick' in text
    assert '--quick' not in heading({'machine': facts, 'quick': False})
    assert 'interpreted' in heading({'machine': facts | {'compiled': False}, 'quick': False})
