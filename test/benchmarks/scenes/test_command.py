# Copyright 2026 The slip_detector maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
