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

"""Decorators for methods of a managed node: mutual exclusion, and errors that are reported."""

import functools
from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec, TypeVar

from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn

Arguments = ParamSpec('Arguments')
Returned = TypeVar('Returned')
Transition = Callable[[Any, LifecycleState], TransitionCallbackReturn]


def exclusive(
    method: Callable[Concatenate[Any, Arguments], Returned],
) -> Callable[Concatenate[Any, Arguments], Returned]:
    """Let only one thread at a time run the methods with this decorator.

    The lock is the object's attribute ``_lock``.

    Examples
    --------
    >>> import threading
    >>> class Counter:
    ...     def __init__(self):
    ...         self._lock, self.count = threading.RLock(), 0
    ...     @exclusive
    ...     def up(self):
    ...         self.count += 1
    >>> counter = Counter()
    >>> counter.up()
    >>> counter.count
    1
    """

    @functools.wraps(method)
    def run(self: Any, /, *words: Arguments.args, **named: Arguments.kwargs) -> Returned:
        with self._lock:
            return method(self, *words, **named)

    return run


def explained(method: Transition) -> Transition:
    """Keep the error of a failed transition in ``_failed``, and log it: rclpy drops the exception.

    With ``autostart`` it is not logged, as the node's constructor raises it.
    """

    @functools.wraps(method)
    def run(self: Any, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return method(self, state)
        except Exception as error:
            self._failed = ' '.join(str(error).split()) or type(error).__name__
            if not self.config.autostart:
                self.get_logger().error(self._failed)
            return TransitionCallbackReturn.ERROR

    return run
