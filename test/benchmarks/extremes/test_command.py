"""The subcommand ``extremes``."""

from benchmarks.extremes import command


def test_quick_is_handed_on_and_the_table_is_that_of_the_figures(monkeypatch):
    monkeypatch.setattr(
        command, 'measure_extremes', lambda quick: {'extremes': [], 'asked': quick}
    )
    monkeypatch.setattr(command, 'extremes_table', lambda figures: f'table of {figures["asked"]}')
    measurement = command.run(command.options().parse_args(['--quick']))
    assert measurement.text == 'table of True'
    assert set(measurement.figures) == {'machine', 'quick', 'extremes', 'asked'}
