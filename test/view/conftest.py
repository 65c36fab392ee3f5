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

"""The live page in a browser without a screen."""

import asyncio
import contextlib
import inspect

import pytest

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view import server
from slip_detector.view.parameters import ParameterRequests
from slip_detector.view.teaching import Teaching
from support.browsers import complaints_of
from support.simulated_detectors import SimulatedDetectors, served_beside

#: Width and height of the window, where a test asks for no other.
WINDOW = (1366, 768)

#: Longest time of a coroutine, in seconds.
DEADLINE_S = 180.0


def pytest_pyfunc_call(pyfuncitem):
    """Run a test that is a coroutine."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    names = pyfuncitem._fixtureinfo.argnames
    test = pyfuncitem.obj(**{name: pyfuncitem.funcargs[name] for name in names})
    asyncio.run(asyncio.wait_for(test, DEADLINE_S))
    return True


@pytest.fixture
def open_page(browser, monkeypatch):
    """Return what opens the page of a served hand; what it complains of fails the test.

    Nothing may be asked of any other address. Frames come less often than for a user: drawing 30 a
    second takes a third of a core.
    """
    opened = []
    monkeypatch.setattr(server, 'FRAME_S', 1 / 10)

    def open_(served, size=WINDOW):
        page = browser.new_page()
        page.set_viewport_size(dict(zip(('width', 'height'), size, strict=True)))
        opened.append(complaints_of(page, served.url.partition('?')[0]))
        served.before_end(page.close)  # It would complain of the end.
        page.goto(served.url)
        page.locator('[data-state]').first.wait_for(state='attached', timeout=60_000)
        return page

    yield open_
    assert [complaints for complaints in opened if complaints] == []


@pytest.fixture
def serve(tmp_path, open_page):
    """Return what serves a hand as ``slip_view`` does, with a folder of the test, and its page."""

    def serve_(detectors, files=(), access=None, size=WINDOW):
        def prepare(server):
            ParameterRequests(server, tmp_path, files)
            Teaching(server, tmp_path)

        served = ends.enter_context(served_beside(detectors, access=access, prepare=prepare))
        return served, open_page(served, size)

    with contextlib.ExitStack() as ends:
        yield serve_


@pytest.fixture
def played(serve):
    """Return what opens a page on fingers that play rows: by label the rows."""

    def open_(rows_of, prepare=lambda detectors: None, size=WINDOW, config=None):
        detectors = SimulatedDetectors(())
        for label, rows in rows_of.items():
            detectors.add(label, config or DetectorConfig(), rows=rows)
        prepare(detectors)
        return serve(detectors, size=size)

    return open_
