"""The machine, and how it is named above the tables."""

import importlib.metadata

from benchmarks.measurement import heading, machine
from slip_detector.chain.compiled import COMPILED


def test_the_machine_is_described_with_the_versions_that_are_installed():
    facts = machine()
    assert facts['numpy'] == importlib.metadata.version('numpy')
    assert facts['scipy'] == importlib.metadata.version('scipy')
    assert facts['compiled'] is COMPILED
    assert (facts['numba'] is None) is not COMPILED
    assert facts['cores'] >= 1


def test_the_heading_names_the_machine_and_whether_it_was_quick():
    facts = machine() | {'cores': 77, 'numba': '0.0', 'compiled': True}
    text = heading({'machine': facts, 'quick': True})
    assert '77 cores' in text
    assert 'Numba 0.0' in text
    assert '--quick' in text
    assert '--quick' not in heading({'machine': facts, 'quick': False})
    assert 'interpreted' in heading({'machine': facts | {'compiled': False}, 'quick': False})
