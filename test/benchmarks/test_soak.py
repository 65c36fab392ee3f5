"""A short soak of the real nodes, and what is said of its figures."""

import json

import pytest

from benchmarks import soak
from support.commands import run

pytest.importorskip('rclpy', reason='needs rclpy')

pytestmark = pytest.mark.nodes

FIGURES = {
    'seconds': 600.0, 'fingers': 2, 'samples': 456_000, 'lost': {'lost and bridged': 3},
    'lost_total': 3, 'latency_median_ms': 0.5, 'latency_p99_ms': [1.0, 1.1],
    'latency_p99_growth': 1.1, 'memory_growth_percent': 0.1,
    'memory_mib': {'slip_detector': 200.0, 'slip_driver': 180.0},
    'cpu_percent': {'slip_detector': 30.0, 'slip_driver': 20.0}, 'cpu_percent_total': 50.0,
}  # fmt: skip


def test_nothing_is_lost_and_all_figures_are_there():
    code, output, errors = run('soak', '--quick', '--seconds', '20', '--json')
    assert code == 0, errors
    result = json.loads(output)
    figures = result['soak']
    assert set(figures) == set(FIGURES)
    assert figures['fingers'] == 1
    assert figures['lost_total'] == 0
    # Of the 20 s there are samples all the time.
    assert figures['samples'] > 19 * 380
    assert 0 < figures['latency_median_ms'] <= max(figures['latency_p99_ms'])
    assert set(result['wanted']) == set(soak.WANTED)


def test_the_table_says_what_was_lost_and_what_is_wanted():
    wanted = {name: {'bound': '<= 0', 'met': name != 'lost_total'} for name in soak.WANTED}
    text = soak.table({'soak': FIGURES, 'wanted': wanted})
    assert 'lost                 3  (wanted <= 0: NOT met)  (3 lost and bridged)' in text
    assert '50 %  (wanted <= 0: met): detectors 30 %, drivers 20 %' in text
