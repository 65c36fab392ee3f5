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
