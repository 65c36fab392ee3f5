"""The subcommand ``soak``."""

import pytest

from benchmarks.soak import command, measure
from benchmarks.soak.measure import QUICK_SECONDS, SECONDS


@pytest.mark.parametrize(
    ('words', 'asked'),
    [
        ([], (SECONDS, 1, 1)),
        (['--quick'], (QUICK_SECONDS, 1, 1)),
        (
            ['--quick', '--seconds', '7', '--fingers', '5', '--samples-per-message', '38'],
            (7.0, 5, 38),
        ),
    ],
)
def test_so_long_so_many_fingers_and_samples_are_asked_for(words, asked, monkeypatch):
    asked_for = []

    def measured(*what):
        asked_for.append(what)
        return {}

    monkeypatch.setattr(command, 'measure_soak', measured)
    monkeypatch.setattr(command, 'soak_table', lambda figures: 'the table')
    assert command.run(command.options().parse_args(words)).text.endswith('\n\nthe table')
    assert asked_for == [asked]


def test_where_no_node_can_run_the_soak_says_why(monkeypatch):
    monkeypatch.setattr(measure, 'why_not_ros', lambda: 'rclpy cannot be imported (so)')
    with pytest.raises(RuntimeError, match=r'the soak needs the nodes: rclpy cannot .* \(so\)'):
        measure.measure_soak(1.0, 1, 1)
