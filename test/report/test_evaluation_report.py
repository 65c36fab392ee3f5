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

"""The report of an evaluation."""

import json
import re

import numpy as np
import pytest

from slip_detector.evaluation.evaluator import RecordingLoader, evaluate_recording
from slip_detector.report.evaluation_report import overview_factory, write_evaluation_report
from support import report_scenes as scenes


@pytest.fixture(scope='module')
def sets(tmp_path_factory):
    """Return two sets of one recording each, evaluated, with their overviews."""
    loader = RecordingLoader(scenes.GIVEN)
    found = {}
    for k, name in enumerate(('x', 'y')):
        path = tmp_path_factory.mktemp(name) / 'a.npz'
        volts, truth = scenes.volts_and_truth(seed=k)
        np.savez(path, volts=volts, slip=truth, sample_rate_hz=380.0)
        found[name] = {
            'a.npz': evaluate_recording(loader, path, overview_factory(scenes.GIVEN, 2))
        }
    return found


def test_recordings_of_several_sets_bear_the_names_of_both_and_have_their_events(sets, tmp_path):
    page = tmp_path / 'page.html'
    assert write_evaluation_report(sets, scenes.GIVEN, page, None) == [page]
    (text,) = re.findall(r'id="header">(.*?)</script>', page.read_text(encoding='utf-8'))
    recordings = json.loads(text)['recordings']
    assert [recording['name'] for recording in recordings] == ['x/a.npz', 'y/a.npz']
    for recording, one in zip(recordings, (sets['x'], sets['y']), strict=True):
        (variant,) = recording['variants']
        slips = [event for event in variant['events'] if event[0] > 0]
        assert len(slips) == len(one['a.npz'].outcome.slips) == len(scenes.SLIPS_S)


def test_a_picture_that_cannot_be_written_is_named(sets, tmp_path):
    (tmp_path / 'evaluation.png').mkdir()
    with pytest.raises(ValueError, match=r'evaluation\.png: cannot be written'):
        write_evaluation_report(sets, scenes.GIVEN, None, tmp_path)
