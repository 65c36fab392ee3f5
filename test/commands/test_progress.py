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
