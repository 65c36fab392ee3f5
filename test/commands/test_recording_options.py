"""The options that say what to read of a recording."""

import argparse
import dataclasses

from slip_detector.commands.recording_options import (
    add_recording_options,
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
