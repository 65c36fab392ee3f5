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

"""Settings of the whole test run."""

import gc
import os
import signal
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import settings

from support.domains import own_domain

ROOT = Path(__file__).resolve().parents[1]

#: Every test in these folders is marked ``nodes``.
OF_NODES = tuple(ROOT / name for name in ('slip_detector/nodes', 'test/nodes', 'test/launch'))

# A run in the background ignores SIGINT, and what it starts would too.
signal.signal(signal.SIGINT, signal.default_int_handler)

# For what the tests run as a user does.
os.environ['ROS_DOMAIN_ID'] = str(own_domain()[0])

# Derandomised: a run says the same about the same code, here and on every other machine.
settings.register_profile(
    'slip_detector', deadline=None, derandomize=True, max_examples=60, database=None
)
settings.load_profile('slip_detector')


def pytest_ignore_collect(collection_path, config):
    """Load nothing of the nodes where rclpy is missing, or all marked ``nodes`` is left out."""
    wanted = config.option.markexpr != 'not nodes' and find_spec('rclpy')
    return None if wanted or collection_path not in OF_NODES else True


def pytest_collection_modifyitems(items):
    """Mark the tests in the folders of the nodes, and let those that mostly wait begin.

    Those in a browser wait half of their time: one worker runs them while others compute. At the
    end all would wait at once.
    """
    for item in items:
        if any(item.path.is_relative_to(folder) for folder in OF_NODES):
            item.add_marker(pytest.mark.nodes)
    items.sort(key=lambda item: not item.path.is_relative_to(ROOT / 'test' / 'view'))


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Leave what is loaded while tests are collected, which stays, out of garbage collection."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture
def bench():
    """A domain with a node of the test's own, for any number of processes."""
    from support.harness import Bench

    bench = Bench()
    yield bench
    bench.close()


@pytest.fixture
def port(tmp_path):
    """A serial port that a sensor is plugged into."""
    from support.sensors import Port

    port = Port(tmp_path / 'tty')
    yield port
    port.unplug()


@pytest.fixture(scope='module')
def browser():
    """A browser without a screen; tests are skipped where it is absent and not required.

    All tests of a module open their pages in one process of it: starting one for each page costs
    as much as loading the page.
    """
    from benchmarks.view import browser as system_browser
    from support.browsers import require_browser

    require_browser()
    flags = '--renderer-process-limit=1', '--disable-site-isolation-trials'
    with system_browser.browser(*flags) as running:
        context = running.new_context(viewport={'width': 1366, 'height': 768})
        context.new_page()  # The process ends with its last page.
        yield context
