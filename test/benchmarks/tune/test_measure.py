"""What is measured of the tuner."""

from benchmarks.tune.measure import measure_tuning
from benchmarks.tune.table import tuning_table


def test_quick_figures_are_shown_and_not_judged():
    result = measure_tuning(quick=True, parts=['search'])
    text = tuning_table(result)
    wanted = result['wanted']
    assert wanted['search.speedup']['value'] == result['search']['speedup']
    assert wanted['search.speedup']['met'] is None
    assert wanted['evaluate.ratio'] == {'value': None, 'bound': '<= 4', 'met': None}
    assert [line.split()[-2:] for line in text.splitlines()].count(['not', 'judged']) == 1
    assert 'met' not in text
