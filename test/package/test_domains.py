"""Tests that run side by side keep out of each other's way."""

import itertools
import os

from support import domains


def test_a_run_that_begins_with_the_same_domain_takes_another(monkeypatch):
    own, lock = domains.own_domain()
    monkeypatch.setattr(domains, '_next', itertools.count(own - 1))
    other, other_lock = domains.own_domain()
    os.close(lock)
    os.close(other_lock)
    assert other != own
    assert {own, other} <= set(range(1, domains.N_DOMAINS + 1))
