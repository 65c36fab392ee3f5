"""The way of a newcomer, on short recordings."""

from benchmarks.tune.new_sensor import measure_new_sensor


def test_three_commands_make_a_configuration_of_recordings():
    figures = measure_new_sensor(trials=2, recorded=range(1), rest_s=15.0, knocks_s=9.0)
    assert figures['recording_s'] > 3 * 9.0 + 24.0
    times_s = [figures[f'{name}_s'] for name in ('quiet', 'taps', 'search')]
    assert figures['total_s'] == sum(times_s)
    assert min(times_s) > 0.0
    assert figures['taps_told']
    assert figures['given']['slips'] == figures['tuned']['slips'] == 9
