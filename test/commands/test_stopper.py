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
