"""Parameter files that are written, whole or not at all."""

import pytest
import yaml

from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.writing import (
    check_writable,
    with_parameters,
    writable_folder,
    write_file,
)


def test_changes_win_over_every_section_and_all_else_stays(tmp_path):
    path = tmp_path / 'given.yaml'
    path.write_text(
        '/**/slip_detector:\n  ros__parameters: {threshold: 0.7, gain: 50.0}\n'
        'slip_driver:\n  ros__parameters: {seed: 3}\n'
        '/**:\n  ros__parameters: {threshold: 0.9}\n'
    )
    document = with_parameters(path, {'threshold': 0.2})
    write_file(tmp_path / 'new.yaml', document, ['Tuned.', ''])
    text = (tmp_path / 'new.yaml').read_text()
    assert text.startswith('# Tuned.\n#\n')
    assert ChainConfig.from_yaml(tmp_path / 'new.yaml') == ChainConfig(threshold=0.2, gain=50.0)
    assert yaml.safe_load(text)['slip_driver'] == {'ros__parameters': {'seed': 3}}
    # What was given is not changed.
    assert yaml.safe_load(path.read_text())['/**']['ros__parameters']['threshold'] == 0.9


def test_a_file_without_the_detectors_section_gets_one(tmp_path):
    path = tmp_path / 'given.yaml'
    path.write_text('slip_driver:\n  ros__parameters: {seed: 3}\n')
    document = with_parameters(path, {'threshold': 0.2})
    assert document['/**/slip_detector'] == {'ros__parameters': {'threshold': 0.2}}


def test_a_file_that_cannot_be_written_is_named_and_nothing_is_left(tmp_path):
    for path in (tmp_path / 'no' / 'a.yaml', tmp_path):
        for write in (check_writable, lambda path: write_file(path, {}, [])):
            with pytest.raises(ValueError, match='cannot be written') as caught:
                write(path)
            assert str(caught.value).startswith(f'{path}: ')
    assert list(tmp_path.iterdir()) == []


def test_checking_changes_nothing(tmp_path):
    old, new = tmp_path / 'old', tmp_path / 'new'
    old.write_text('old')
    check_writable(old)
    check_writable(new)
    assert [path.name for path in tmp_path.iterdir()] == ['old']
    assert old.read_text() == 'old'


def test_a_folder_is_made_unless_a_file_stands_there(tmp_path):
    assert writable_folder(tmp_path / 'a' / 'b').is_dir()
    (tmp_path / 'file').write_text('')
    with pytest.raises(ValueError, match='file: cannot be made'):
        writable_folder(tmp_path / 'file')
