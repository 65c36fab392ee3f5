"""Hours of recording evaluated in a second."""

import pytest

from benchmarks.tune.jobs_speed import measure_jobs


def test_both_formats_are_evaluated_with_each_number_of_jobs_to_the_same_figures():
    pytest.importorskip('rosbags', reason='needs rosbags')
    result = measure_jobs(recordings=2, minutes=0.2, rounds=1)
    assert result['same']
    for ending in ('npz', 'mcap'):
        assert set(result[ending]['hours_per_s']) == {'1', '2'}
        assert all(speed > 0.0 for speed in result[ending]['hours_per_s'].values())
        # 16 values of 8 bytes a row at least.
        assert result[ending]['bytes_per_hour'] > 3600 * 380 * 16 * 8
    assert result['memory_mib'] > 50.0
