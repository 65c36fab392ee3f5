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

"""What ``slip_evaluate`` reads of recordings: their labels, rates, gaps and motion."""

import pytest

from slip_detector.commands.evaluate import main
from slip_detector.recordings.writing import BagWriter
from support.evaluation_cases import report_of


def test_a_bag_that_was_cut_off_is_evaluated_and_says_so(capsys, tmp_path):
    bags = pytest.importorskip('support.bags', reason='needs rosbags')
    written = bags.rows(800, channels=16)
    writer = BagWriter(tmp_path / 'a', [f'ch{k + 1}' for k in range(16)])
    for first in (0, 400):
        writer.write(written.take(slice(first, first + 400)))
        writer.flush()
    writer.close()
    content = writer.path.read_bytes()
    writer.path.write_bytes(content[: 3 * len(content) // 4])
    figures = report_of(capsys, writer.path)['a']
    assert figures['rows'] == 400
    (of_file,) = figures['recordings'].values()
    assert 'is cut off' in of_file['lost']
    assert main([str(writer.path)]) == 0
    assert f'a.mcap: {of_file["lost"]}' in capsys.readouterr().out.splitlines()
