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

"""The package as it runs where Numba is missing."""

import importlib
import sys
from functools import cache
from unittest import mock

import slip_detector.chain
import slip_detector.scenes
import slip_detector.vectors

#: What is imported once more.
ROOMS = ('chain', 'compiled', 'scenes', 'vectors')


@cache
def interpreted(module):
    """Import a module of the package once more, with no Numba to be found.

    The first one stays in place.
    """
    again = tuple(f'slip_detector.{room}' for room in ROOMS)
    with (
        mock.patch.dict(sys.modules, {'numba': None}),
        mock.patch.multiple(slip_detector, **dict.fromkeys(ROOMS)),
    ):
        for name in [name for name in sys.modules if name.startswith(again)]:
            del sys.modules[name]
        assert not importlib.import_module('slip_detector.compiled').COMPILED
        return importlib.import_module(f'slip_detector.{module}')
