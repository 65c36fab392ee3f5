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

"""The subcommand ``view``."""

from benchmarks.view import command


def test_how_long_is_passed_on_and_the_table_printed(monkeypatch):
    asked = []

    def measured(*what):
        asked.append(what)
        return {}

    monkeypatch.setattr(command, 'measure_view', measured)
    monkeypatch.setattr(command, 'view_table', lambda figures: 'the table')
    for words in ([], ['--quick'], ['--seconds', '7']):
        measurement = command.run(command.options().parse_args(words))
        assert measurement.text.endswith('\n\nthe table')
    assert asked == [(False, None), (True, None), (False, 7.0)]
