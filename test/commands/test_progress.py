"""The bar of a command."""

import io
import sys

from slip_detector.commands.progress import progress_bar


class Terminal(io.StringIO):
    def isatty(self):
        return True


def shown_on(stream, monkeypatch):
    monkeypatch.setattr(sys, 'stderr', stream)
    with progress_bar(total=3, unit='recording', done=1) as bar:
        bar.update()
    return stream.getvalue()


def test_a_terminal_shows_each_step_at_once(monkeypatch):
    shown = shown_on(Terminal(), monkeypatch)
    assert '1/3' in shown
    assert '2/3' in shown


def test_what_is_no_terminal_stays_empty(monkeypatch):
    assert shown_on(io.StringIO(), monkeypatch) == ''
