"""The subcommand ``scenes``."""

from benchmarks.scenes import command


def test_the_scenes_asked_for_are_measured_and_drawn(scenes_figures, monkeypatch, tmp_path):
    asked = []

    def measured(*what):
        asked.append(what)
        return scenes_figures

    monkeypatch.setattr(command, 'measure_scenes', measured)
    picture = tmp_path / 'new' / 'picture.png'
    words = ['--quick', '--scene', 'taps', '--scene', 'rolling', '--plot', str(picture)]
    measurement = command.run(command.options().parse_args(words))
    assert asked == [(True, ['taps', 'rolling'])]
    assert set(measurement.figures) == {'machine', 'quick', *scenes_figures}
    assert measurement.text.startswith('Machine')
    assert picture.read_bytes().startswith(b'\x89PNG')
