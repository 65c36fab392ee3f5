"""The figures of the soak as text."""

from benchmarks.soak.measure import WANTED
from benchmarks.soak.table import soak_table

FIGURES = {
    'seconds': 600.0, 'fingers': 2, 'samples': 456_000, 'lost': {'lost and bridged': 3},
    'lost_total': 3, 'latency_median_ms': 0.5, 'latency_p99_ms': [1.0, 1.1],
    'latency_p99_growth': 1.1, 'memory_growth_percent': 0.1,
    'memory_mib': {'slip_detector': 200.0, 'slip_driver': 180.0},
    'cpu_percent': {'slip_detector': 30.0, 'slip_driver': 20.0}, 'cpu_percent_total': 50.0,
}  # fmt: skip


def test_the_table_says_what_was_lost_and_what_is_wanted():
    wanted = {
        name: {'value': 1.0, 'bound': '<= 0', 'met': name != 'lost_total'} for name in WANTED
    }
    text = soak_table({'soak': FIGURES, 'wanted': wanted})
    assert 'lost                 3  (wanted <= 0: NOT met)  (3 lost and bridged)' in text
    assert '50 %  (wanted <= 0: met): detectors 30 %, drivers 20 %' in text
