"""A short soak of the real nodes."""

import json

import pytest

from benchmarks.soak import measure
from benchmarks.soak.table import soak_table
from support.benchmarks import run

pytest.importorskip('rclpy', reason='needs rclpy')

pytestmark = pytest.mark.nodes


@pytest.mark.parametrize(
    ('part', 'fingers', 'samples_a_second'), [('finger', 1, 380), ('fast_hand', 5, 5 * 1000)]
)
def test_nothing_is_lost_and_all_figures_are_there(part, fingers, samples_a_second):
    code, output, errors = run('soak', '--part', part, '--seconds', '20', '--json')
    assert code == 0, errors
    result = json.loads(output)
    figures = result[part]
    for name in figures:
        assert f'``{name}``' in measure.__doc__
    assert f'{figures["samples"]:,} samples' in soak_table(result)
    assert figures['fingers'] == fingers
    assert figures['lost_total'] == 0
    # Of the 20 s there are samples all the time.
    assert figures['samples'] > 19 * samples_a_second
    assert 0 < figures['latency_median_ms'] <= max(figures['latency_p99_ms'])
    assert set(result['wanted']) == set(measure.WANTED)
