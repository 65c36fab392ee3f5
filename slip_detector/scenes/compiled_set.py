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

"""The sets of parameters that compiled code takes."""

from collections import namedtuple
from typing import Any, ClassVar

from slip_detector.parameters.sets import ParameterSet


class CompiledSet(ParameterSet):
    """A set whose values compiled code takes, as a named tuple, which Numba can take."""

    Numbers: ClassVar[Any]

    def __init_subclass__(cls) -> None:
        """Make the class of the named tuple."""
        super().__init_subclass__()
        numbers: Any = namedtuple('Numbers', [*cls.__annotations__], module=cls.__module__)  # type: ignore[misc]
        cls.Numbers = numbers
        # By this name Numba finds the tuple of a function that it has compiled in another process.
        cls.Numbers.__qualname__ = f'{cls.__qualname__}.Numbers'

    def numbers(self) -> Any:
        """Return the named tuple of the values."""
        return self.Numbers(*(getattr(self, name) for name in self.Numbers._fields))
