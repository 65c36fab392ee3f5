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

"""Processes: that failures are said in a line, and that nothing outlives its measurement."""

import os
import signal
import subprocess
import sys

import pytest

from benchmarks.processes import (
    CHECKOUT,
    exit_on_termination,
    figures_of_process,
    last_line,
    memory_kib,
    nodes_running,
    print_figures,
    processor_time_s,
    raise_if_ended,
)

#: Runs until it is ended.
ENDLESS = [sys.executable, '-c', 'import signal; signal.pause()']


def test_without_rclpy_the_reason_is_said(tmp_path):
    # A package that cannot be imported, found before any that can.
    (tmp_path / 'rclpy.py').write_text('raise ImportError("no such thing here")\n')
    code = 'from benchmarks.processes import why_not_ros; print(why_not_ros())'
    environment = os.environ | {'PYTHONPATH': os.pathsep.join([str(tmp_path), str(CHECKOUT)])}
    output = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, env=environment, check=True
    ).stdout
    assert 'rclpy cannot be imported' in output
    assert 'no such thing here' in output


def test_the_last_line_is_what_a_process_ended_with():
    assert last_line('one\ntwo\n\n') == 'two'
    assert last_line('') == 'it wrote nothing'


def test_a_process_that_fails_is_an_error_with_its_last_line():
    with pytest.raises(RuntimeError, match=r'failed: .*No module named .*no_such_module'):
        figures_of_process('benchmarks.no_such_module', [], timeout_s=60.0)


def test_a_process_that_does_not_end_in_time_is_ended_and_an_error():
    # A module that runs until it is ended.
    with pytest.raises(RuntimeError, match=r'http\.server did not end within 1 s'):
        figures_of_process('http.server', ['--bind', '127.0.0.1', '0'], timeout_s=1.0)


def test_figures_are_printed_as_json_and_errors_as_a_line(capsys):
    assert print_figures(lambda: {'a': 1.5}) == 0
    assert capsys.readouterr().out == '{"a": 1.5}\n'

    def failing():
        raise RuntimeError('no figures today')

    assert print_figures(failing) == 1
    assert capsys.readouterr().err == 'no figures today\n'


def test_a_signal_exits_and_the_handler_of_before_comes_back():
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(SystemExit, match='143'), exit_on_termination():
        signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is before


def test_processes_run_until_the_block_ends():
    with nodes_running({'one': ENDLESS, 'other': ENDLESS}) as processes:
        raise_if_ended(processes)
        assert all(process.poll() is None for process in processes.values())
        assert memory_kib(processes['one'].pid) > 0
        assert processor_time_s(processes['one'].pid) >= 0.0
    assert all(process.returncode == -signal.SIGTERM for process in processes.values())


def test_a_process_that_ended_is_named_with_its_exit_code():
    with nodes_running({'one': [sys.executable, '-c', 'raise SystemExit(3)']}) as processes:
        processes['one'].wait()
        with pytest.raises(RuntimeError, match='one ended with the exit code 3'):
            raise_if_ended(processes)
