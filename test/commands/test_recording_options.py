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

"""The options that say what to read of a recording."""

import argparse
import dataclasses

from slip_detector.commands.recording_options import (
    add_recording_options,
    paths_read,
    with_recording_options,
)
from slip_detector.parameters.recording import RecordingConfig


def test_the_options_say_what_the_parameters_say():
    parser = argparse.ArgumentParser()
    add_recording_options(parser)
    config = RecordingConfig(recording_topic='/mine', recording_labels='by_hand')
    assert with_recording_options(config, parser.parse_args([])) == config
    words = ['--topic', '/biotac', '--field', 'pac', '--labels', 'l.yaml', '--resample']
    assert with_recording_options(config, parser.parse_args(words)) == dataclasses.replace(
        config,
        recording_topic='/biotac',
        recording_field='pac',
        recording_labels='l.yaml',
        recording_resample=True,
    )


def test_what_a_command_reads_is_each_recording_of_its_folders_and_the_labels(tmp_path):
    for name in ('a.npz', 'b.csv', 'c.txt'):
        (tmp_path / name).touch()
    options = argparse.Namespace(
        recordings=[str(tmp_path)], held_out=['h.mcap'], quiet=None, taps='t.npz', labels='l.yaml'
    )
    assert [path.name for path in paths_read(options)] == [
        'a.npz', 'b.csv', 'h.mcap', 't.npz', 'l.yaml',
    ]  # fmt: skip
