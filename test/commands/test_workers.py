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

"""Calls in this process, in several, and the options that recordings are read with."""

import argparse
import os
import signal
import sys

import pytest

from slip_detector.commands import workers
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.parameters.yaml_files import write_yaml
from support.config_cases import message_of
from support.python_runs import run_python

PID = '__import__("os").getpid()'


def test_several_jobs_are_processes_that_end_with_the_context():
    with workers.processes(jobs=1) as calls:
        assert calls is None  # it is this process
    with workers.processes(jobs=2) as calls:
        results = dict(calls(eval, [f'{k}, {PID}' for k in range(20)]))
        assert all(results[k][0] == k for k in range(20))
        assert dict(calls(eval, [])) == {}
    for pid in {pid for _, pid in results.values()}:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_a_call_that_fails_or_dies_is_one_line():
    for call, argument, said in (
        (int, 'x', r'^invalid literal for int\(\) .*$'),
        (signal.raise_signal, signal.SIGKILL, r'^a worker process died, allowed: fewer'),
    ):
        with workers.processes(jobs=2) as calls, pytest.raises(ValueError, match=said):
            list(calls(call, [argument]))


def test_processes_end_with_the_one_that_started_them():
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}
    begin = 'import signal\nfrom slip_detector.commands.workers import processes\n'
    begin += 'with processes(jobs=2) as calls:\n    '
    for code, status, printed in (
        # It does not return before the last process that has the pipe has ended.
        ('print(*calls(eval, ["7"]), flush=True); signal.raise_signal(9)', -9, '(0, 7)\n'),
        # A result that is being written does not hold up the end.
        ('next(calls(bytes, [1, 300_000_000]))', 0, ''),
    ):
        done = run_python('-c', begin + code, env=environment)
        assert (done.returncode, done.stdout) == (status, printed), done.stderr


def test_options_replace_parameters_of_recordings(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = RecordingConfig(recording_topic='/mine', recording_labels='by_hand')
    write_yaml(tmp_path / 'c.yaml', given.to_document())
    (tmp_path / 'l.yaml').touch()

    def recording_config(*words):
        parser = argparse.ArgumentParser()
        workers.add_options(parser, 'work')
        options = parser.parse_args(['--config', 'c.yaml', *words])
        return workers.apply_options(options, RecordingLoader()).recording_config

    assert recording_config() == given
    words = ['--topic', '/biotac', '--field', 'pac', '--labels', 'l.yaml', '--resample']
    found = recording_config(*words).to_parameters()
    read = [found[f'recording_{name}'] for name in workers.RECORDING_OPTIONS]
    assert read == ['/biotac', 'pac', 'l.yaml', True]


def test_what_cannot_be_written_is_refused_and_nothing_is_changed(tmp_path, monkeypatch):
    for path in (tmp_path / 'no' / 'a', tmp_path):
        assert message_of(workers.check_writable, path).startswith(f'{path}: cannot be written (')
    old, link = tmp_path / 'old', tmp_path / 'link'
    old.write_text('old')
    link.symlink_to(tmp_path / 'not there')
    for path in (old, link, tmp_path / 'new'):
        workers.check_writable(path)
    # As its mode is for all users but root.
    monkeypatch.setattr(workers.os, 'access', lambda path, how: how != os.W_OK)
    said = f'{old}: cannot be written (is write-protected)'
    assert message_of(workers.check_writable, old) == said
    assert {*tmp_path.iterdir()} == {old, link}
    assert old.read_text() == 'old'


def test_a_file_is_not_written_twice_nor_over_what_is_read(tmp_path):
    out, link, recording = tmp_path / 'a.yaml', tmp_path / 'link.yaml', tmp_path / 'b.npz'
    link.symlink_to(out)
    workers.check_apart({'--out': out, '--report': None}, None, 'labels.yaml')
    for written, read, said in (
        ({'--out': out, '--report': link}, None, f'--report {link}: is written by --out too'),
        ({'--out': out}, str(link), f'--out {out}: is read too'),
        ({'--out': recording}, None, f'--out {recording}: is a recording'),
    ):
        message = message_of(workers.check_apart, written, read)
        assert message == f'{said}, allowed: a file of its own'
