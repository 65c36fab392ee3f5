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

"""The live page measured for a short time, with real nodes and a real browser."""

import json

import pytest

from benchmarks.view import measure
from benchmarks.view.table import view_table
from support.benchmarks import run
from support.browsers import require_browser

pytest.importorskip('rclpy', reason='needs rclpy')

pytestmark = pytest.mark.nodes


def test_all_figures_are_there_and_each_is_told():
    require_browser()
    code, output, errors = run('view', '--quick', '--json')
    assert code == 0, errors
    figures = json.loads(output)
    assert figures['fingers'] == 5
    for who in ('closed', 'elsewhere', 'here'):
        for name in figures[who]:
            assert f'``{name}``' in measure.__doc__, name
        assert 0.0 < figures[who]['latency_median_ms'] <= figures[who]['latency_p99_ms']
        assert figures[who]['cpu_percent'].keys() == {'slip_detector', 'slip_driver', 'slip_view'}
    closed, elsewhere, here = (figures[who] for who in ('closed', 'elsewhere', 'here'))
    # Nothing is received while nobody looks.
    assert closed['slip_view_cpu_percent'] < elsewhere['slip_view_cpu_percent']
    for looking in (elsewhere, here):
        assert 1.0 < looking['frames_a_second'] < 31.0
    assert here['browser_cpu_percent'] > 1.0
    assert 1.0 < here['heap_mib'] < 100.0
    assert here['memory_mib'] > 50.0
    assert {verdict['met'] for verdict in figures['wanted'].values()} == {None}
    assert here['seconds'] >= 8.0
    told = f'Chromium draws them on this machine, {here["seconds"]:.0f} s'
    assert told in view_table(figures)


@pytest.mark.parametrize(
    ('quick', 'seconds', 'words'),
    [
        (False, None, ['60.0', '5', '20.0']),
        (True, None, ['8.0', '2', '4.0']),
        (False, 3600.0, ['3600.0', '5', '20.0']),
    ],
)
def test_it_runs_for_its_time_and_the_latency_is_judged_by_the_noise(
    quick, seconds, words, monkeypatch
):
    ran = []

    def figures_of_process(module, arguments, timeout_s, environment):
        ran.append((module, arguments, environment))
        assert timeout_s > float(arguments[1])
        return {'closed': {'latency_noise': 1.2}, 'elsewhere': {'latency_ratio': 1.3}}

    monkeypatch.setattr(measure, 'why_not_ros', lambda: '')
    monkeypatch.setattr(measure, 'why_no_browser', lambda: '')
    monkeypatch.setattr(measure, 'figures_of_process', figures_of_process)
    wanted = measure.measure_view(quick, seconds)['wanted']
    arguments = ['--seconds', words[0], '--pairs', words[1], '--turn-seconds', words[2]]
    assert ran == [('benchmarks.view.session', arguments, {'ROS_DOMAIN_ID': '101'})]
    ratio = wanted['elsewhere.latency_ratio']
    assert ratio == {'value': 1.3, 'bound': '<= 1.2', 'met': None if quick else False}


@pytest.mark.parametrize('missing', ['why_not_ros', 'why_no_browser'])
def test_what_is_missing_is_told(missing, monkeypatch):
    for name in ('why_not_ros', 'why_no_browser'):
        monkeypatch.setattr(measure, name, lambda name=name: 'is not there' * (name == missing))
    with pytest.raises(RuntimeError, match='the live page cannot be measured: is not there'):
        measure.measure_view(quick=True)
