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

"""How many processes work, and with which paths."""

import argparse
import os

import pytest

from slip_detector.commands.worker_options import (
    add_worker_options,
    config_for_workers,
    paths_for_workers,
    workers_of,
)
from slip_detector.parameters.recording import RecordingConfig


def options_of(*words):
    parser = argparse.ArgumentParser()
    add_worker_options(parser, 'work')
    return parser.parse_args(words)


@pytest.mark.parametrize(
    ('words', 'here'),
    [
        ((), True),
        (('--jobs', '1'), True),
        (('--jobs', '2'), False),
        (('--cluster', 'tcp://127.0.0.1:8786'), False),
    ],
)
def test_without_options_the_work_is_done_in_this_process(words, here):
    assert workers_of(options_of(*words)).here == here


def test_a_cluster_gets_whole_paths_and_processes_the_given_ones(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    config = RecordingConfig(recording_labels='labels')
    here, there = options_of('--jobs', '2'), options_of('--cluster', 'tcp://127.0.0.1:8786')
    assert paths_for_workers(here, ['a.npz']) == ['a.npz']
    assert config_for_workers(here, config) == config
    assert paths_for_workers(there, ['a.npz', '/b']) == [str(tmp_path / 'a.npz'), '/b']
    assert config_for_workers(there, config).recording_labels == os.path.abspath('labels')
    assert config_for_workers(there, RecordingConfig()) == RecordingConfig()


def test_no_job_at_all_is_refused(capsys):
    with pytest.raises(SystemExit):
        options_of('--jobs', '0')
    assert "is '0', allowed: a whole number from 1" in capsys.readouterr().err
