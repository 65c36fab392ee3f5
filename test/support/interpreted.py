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
import warnings
from functools import cache

ROOM = 'slip_detector.chain'


@cache
def _interpreted_module():
    """Import the chain once more, with no Numba to be found, and leave the first one in place."""
    mine = {
        name: sys.modules.pop(name) for name in list(sys.modules) if name.startswith(f'{ROOM}.')
    }
    numba = {name: sys.modules.pop(name) for name in list(sys.modules) if name == 'numba'}
    sys.modules['numba'] = None
    try:
        return importlib.import_module(f'{ROOM}.slip_chain')
    finally:
        for name in [name for name in sys.modules if name.startswith(f'{ROOM}.')]:
            del sys.modules[name]
        del sys.modules['numba']
        sys.modules.update(numba | mine)


def interpreted_chain(config):
    """Return a SlipChain of which nothing is compiled."""
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', RuntimeWarning)
        return _interpreted_module().SlipChain(config)
