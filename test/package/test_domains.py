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

"""Tests that run side by side keep out of each other's way."""

import itertools
import os

from support import domains


def test_a_run_that_begins_with_the_same_domain_takes_another(monkeypatch):
    own, lock = domains.own_domain()
    monkeypatch.setattr(domains, '_next', itertools.count(own - 1))
    other, other_lock = domains.own_domain()
    os.close(lock)
    os.close(other_lock)
    assert other != own
    assert {own, other} <= set(range(1, domains.N_DOMAINS + 1))
