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

"""What the tests of the commands share."""

import pytest

from support.tuning_cases import PARAMETERS, write


@pytest.fixture
def case(tmp_path):
    """A parameter file and three short recordings."""
    (tmp_path / 'given.yaml').write_text(PARAMETERS)
    paths = [write(tmp_path / f'{name}.npz', seed) for seed, name in enumerate('abc', 4)]
    return tmp_path, [*paths, '--config', str(tmp_path / 'given.yaml')]
