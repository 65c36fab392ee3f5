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

"""ON/OFF slip from the raw voltages of tactile fingertips, after Romeo et al. (2017)."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slip_detector.chain.slip_chain import SlipChain, SlipResult
    from slip_detector.parameters import ChainConfig

__all__ = ['ChainConfig', 'SlipChain', 'SlipResult']


def __getattr__(name: str) -> Any:
    # Loaded when asked for: who wants parameters only need not load SciPy and Numba.
    if name not in __all__:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    module = 'parameters.detector' if name == 'ChainConfig' else 'chain.slip_chain'
    return getattr(importlib.import_module(f'{__name__}.{module}'), name)
