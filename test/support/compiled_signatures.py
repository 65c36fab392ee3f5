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

"""Which functions of the package are compiled."""

import sys


def compiled_signatures():
    """Return the functions that Python has called compiled, and for which types."""
    from numba.core.dispatcher import Dispatcher

    return {
        (f'{name}.{function}', signature)
        for name, module in list(sys.modules.items())
        if name.startswith('slip_detector.')
        for function, value in vars(module).items()
        if isinstance(value, Dispatcher) and value.py_func.__module__ == name
        for signature in value.signatures
    }
