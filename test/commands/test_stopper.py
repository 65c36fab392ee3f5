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

"""The first Ctrl-C and the second."""

import os
import signal

import pytest

from slip_detector.commands.stopper import Stopper


def test_a_first_interrupt_is_a_wish_to_stop_and_a_second_goes_through(capsys):
    stopper = Stopper()
    before = signal.getsignal(signal.SIGINT)
    with stopper.listening():
        assert not stopper()
        os.kill(os.getpid(), signal.SIGINT)
        assert stopper()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before
    assert capsys.readouterr().err.count('stopping') == 1
