"""What the tests of the nodes share."""

import pytest


@pytest.fixture
def bench():
    """A domain with a node of the test's own, for any number of processes."""
    from support.harness import Bench

    bench = Bench()
    yield bench
    bench.close()
