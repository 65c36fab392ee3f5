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

"""The command ``slip_compile``: it compiles all that any other command or node needs."""

import pytest

from slip_detector.commands import compile as command
from slip_detector.commands.evaluate import main as evaluate
from slip_detector.commands.tune import main as tune
from slip_detector.compiled import COMPILED
from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings import write_recording
from slip_detector.scenes.motion import ORDERS
from slip_detector.sources import open_source
from support.compiled_signatures import compiled_signatures

needs_numba = pytest.mark.skipif(not COMPILED, reason='without Numba nothing is compiled')


@needs_numba
@pytest.mark.timeout(1500)  # Where nothing is in the cache, all is compiled.
def test_nothing_is_left_to_be_compiled_when_other_commands_run(tmp_path, capsys):
    pytest.importorskip('optuna', reason='needs optuna')
    assert command.main([]) == 0
    before = compiled_signatures()
    assert before
    paths = []
    for seed in range(2):
        source = open_source(DriverConfig(source='scene', seed=seed))
        path = tmp_path / f'trial_{seed}.npz'
        write_recording(path, [source.read(3000)], source.sample_rate_hz, source.channel_names)
        paths.append(str(path))
    assert evaluate(paths) == 0
    assert tune([*paths, '--trials', '3', '--out', str(tmp_path / 'tuned.yaml')]) == 0
    for scene, orders in (('grasp', [3.0]), ('obedient', ORDERS)):
        obedient = open_source(DriverConfig(source='scene', scene=scene))
        for order in orders:
            obedient.obey(order)
            obedient.read(10)
    capsys.readouterr()
    assert compiled_signatures() == before


def test_it_says_whether_it_compiles_anything(monkeypatch, capsys):
    for compiled, said in (
        (True, 'All is compiled, after '),
        (False, 'Nothing to compile: Numba is not installed'),
    ):
        monkeypatch.setattr(command, 'COMPILED', compiled)
        assert command.main([]) == 0
        assert capsys.readouterr().out.startswith(said)
