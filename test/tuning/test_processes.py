"""Searches in several processes, and the first Ctrl-C."""

import multiprocessing
import os
import signal

import pytest

from slip_detector.tuning.processes import Stopper, search_in_processes
from support.tuning_cases import problem, track


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


def test_what_goes_wrong_in_a_process_is_said_by_the_one_that_started_it(tmp_path):
    asked = problem([track(1, duration_s=6.0)])
    where = str(tmp_path / 'study.journal')
    study = asked.study(where, 'a', seed=0)
    broken = tmp_path / 'broken.journal'
    broken.write_text('no journal\n' * 100)
    with pytest.raises(ValueError, match=f'^storage {broken}: '):
        search_in_processes(
            asked, str(broken), 'a', 3, 1, 0, study, lambda: False, lambda count: None
        )


def test_a_process_that_ends_early_is_said_to_have_ended(tmp_path):
    asked = problem([track(1, duration_s=6.0)])
    where = str(tmp_path / 'study.journal')
    study = asked.study(where, 'a', seed=0)

    def kill():
        for child in multiprocessing.active_children():
            child.kill()
        return False

    with pytest.raises(ValueError, match='process ended with exit code -9; what was found is kep'):
        search_in_processes(asked, where, 'a', 3, 1, 0, study, kill, lambda count: None)
