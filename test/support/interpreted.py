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

"""The chain as it runs where Numba is missing."""

import importlib
import sys
from functools import cache
from unittest import mock

import slip_detector.chain.slip_chain


@cache
def _interpreted_module():
    """Import the chain once more, with no Numba to be found, and leave the first one in place."""
    again = ('slip_detector.chain', 'slip_detector.compiled')
    with (
        mock.patch.dict(sys.modules, {'numba': None}),
        mock.patch.multiple(slip_detector, chain=None, compiled=None),
    ):
        for name in [name for name in sys.modules if name.startswith(again)]:
            del sys.modules[name]
        assert not importlib.import_module('slip_detector.compiled').COMPILED
        return importlib.import_module('slip_detector.chain.slip_chain')


def interpreted_chain(config):
    """Return a SlipChain of which nothing is compiled."""
    return _interpreted_module().SlipChain(config)
