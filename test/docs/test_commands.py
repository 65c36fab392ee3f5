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

"""Every command in README and docs is run.

The commands of this package run here, page by page, in an empty folder with the files that the
page shows and the recordings that it speaks of. Of the others that name the package or what is in
its folder, it is checked that they exist.
"""

import contextlib
import importlib
import io
import os
import re
import shlex
import shutil
import sys
from unittest import mock

import numpy as np
import pytest

from slip_detector.recordings import write_recording
from slip_detector.scenes import find_scene, load_scene
from support.pages import PAGES, ROOT, blocks, file_name, identifier
from support.python_runs import run_python

#: For one command of a page; only ends what hangs.
PATIENCE_S = 500.0

#: Commands of this package that do not run here, as they take long, run until they are ended, or
#: need what a page cannot show. Their tests are those of their rooms.
NOT_HERE = re.compile(
    r'(ros2 run slip_detector )?(slip_detector|slip_view)\b.*|slip_demo --out out|slip_grasp .*'
    r'|slip_evaluate (xela_uskin_slip|trial\.(?:mcap|bag)|/data)\b.*|slip_tune /data.*'
)

#: The console scripts: module and function of each.
SCRIPTS = {
    name: (module, function)
    for name, module, function in re.findall(
        r"f'(\w+) = \{NAME\}\.([\w.]+):(\w+)'", (ROOT / 'setup.py').read_text(encoding='utf-8')
    )
}
#: Those that start nodes.
WITH_NODES = {'slip_demo', 'slip_grasp', 'slip_driver', 'slip_detector', 'grasp_controller'}

#: Code in the text that begins with one of these and goes on is a command.
PROGRAMS = {
    *('make', 'ros2', 'python', 'python3', 'pip', 'colcon', 'rosdep', 'chromium-headless-shell'),
    *SCRIPTS,
}


def commands(block):
    """Return the commands of a block, each as its words."""
    lines = block.text.replace('\\\n', ' ').splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


def commands_in_blocks(path):
    return [words for b in blocks(path) if b.language == 'sh' for words in commands(b)]


def commands_in_text(path):
    text = re.sub(r'^```.*?^```$', '', path.read_text(encoding='utf-8'), flags=re.S | re.M)
    codes = [code for code in re.findall(r'`([^`]+)`', text) if ' ' in code]
    return [shlex.split(code) for code in codes if code.split()[0] in PROGRAMS]


def of_the_package(words):
    """Return the words of a command where its script is on the path, or nothing."""
    words = words[3:] if words[:3] == ['ros2', 'run', 'slip_detector'] else words
    return words if words[0] in SCRIPTS else []


def runs_here(words):
    return not NOT_HERE.fullmatch(' '.join(words)) and bool(of_the_package(words))


def launch_arguments(name):
    """Return what a launch file declares, and those that it includes."""
    text = (ROOT / 'launch' / name).read_text(encoding='utf-8')
    declared = set(re.findall(r"(?:DeclareLaunchArgument\(\s*|^    )'(\w+)'[:,]", text, re.M))
    return declared.union(*map(launch_arguments, re.findall(r"'(\w+\.launch\.py)'", text)))


def is_known(words):
    """Return whether a command that does not run here exists, unless it is another package's."""
    makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
    if words[0] == 'make':
        return re.search(rf'^{words[1]}:', makefile, re.M)
    if words[:3] == ['ros2', 'launch', 'slip_detector']:
        return {word.split(':=')[0] for word in words[4:]} <= launch_arguments(words[3])
    if words[:3] == ['python', '-m', 'benchmarks']:
        if len(words) > 3:
            command = importlib.import_module(f'benchmarks.{words[3]}.command')
            command.options().parse_args(words[4:])
        return True
    if words[:2] == ['pip', 'install']:
        # What pip is told to install is what the package says that it may need.
        setup = (ROOT / 'setup.py').read_text(encoding='utf-8')
        parts = re.findall(r'[\w-]+', ' '.join(w for w in words[2:] if w[:2] != '--'))
        return all(re.search(rf"'{part}[><=']", setup) for part in parts)
    if words[0].startswith('python') and words[1:2] not in ([], ['-m']):
        return (ROOT / words[1]).is_file()
    through_ros = words[:3] == ['ros2', 'run', 'slip_detector'] and words[3:]
    ours = through_ros or words[0].startswith('slip_')
    return not ours or NOT_HERE.fullmatch(' '.join(words))


@pytest.mark.parametrize('path', PAGES, ids=identifier)
def test_each_command_of_a_page_runs_here_or_is_known(path):
    run_here = [words for page in PAGES for words in commands_in_blocks(page) if runs_here(words)]
    shown = [*commands_in_blocks(path), *commands_in_text(path)]
    assert [words for words in shown if words not in run_here and not is_known(words)] == []


def pages_to_run():
    """Yield each page with something to run; what starts nodes is marked so."""
    for path in PAGES:
        here = [of_the_package(words)[0] for words in commands_in_blocks(path) if runs_here(words)]
        if here or any(block.language == 'python' for block in blocks(path)):
            marks = [pytest.mark.nodes] if WITH_NODES & set(here) else []
            yield pytest.param(path, id=identifier(path), marks=marks)


def printed(call, *arguments):
    """Return what a call prints; an exit code is 0."""
    with contextlib.redirect_stdout(io.StringIO()) as output:
        assert not call(*arguments)
    return output.getvalue()


def in_this_process(name, words):
    """Return what a command prints; its modules are loaded once so, and not for each command."""
    module, function = SCRIPTS[name]
    start = getattr(importlib.import_module(f'slip_detector.{module}'), function)
    with mock.patch.object(sys, 'argv', [name, *words]):
        return printed(start)


def in_its_own_process(name, words):
    """Return what a command with nodes prints."""
    module, function = SCRIPTS[name]
    code = f'import sys; from slip_detector.{module} import {function}; sys.exit({function}())'
    environment = {**os.environ, 'PYTHONPATH': str(ROOT)}
    done = run_python('-c', code, *words, timeout=PATIENCE_S, env=environment)
    assert done.returncode == 0, f'{name} {" ".join(words)}:\n{done.stderr}'
    return done.stdout


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """Recordings with slip, and one without, which pages call ``bags``."""
    folder = tmp_path_factory.mktemp('recorded')
    for scene_name in ('plate_400um', 'plate_440um', 'taps'):
        scene = load_scene(find_scene(scene_name), np.random.default_rng(0))
        path = folder / f'{scene_name}.npz'
        write_recording(path, [scene.read(4_500)], scene.sample_rate_hz, scene.channel_names)
    return folder


@pytest.mark.timeout(1500)
@pytest.mark.parametrize('path', list(pages_to_run()))
def test_the_commands_and_programs_of_a_page_run_one_after_the_other(
    path, bags, tmp_path, monkeypatch
):
    work = tmp_path / 'work'
    work.mkdir()
    if '--record bags' not in path.read_text(encoding='utf-8'):
        shutil.copytree(bags, work / 'bags')
    for block in blocks(path):
        if file_name(block):
            (work / file_name(block)).write_text(block.text, encoding='utf-8')

    monkeypatch.chdir(work)
    output = ''
    for block in blocks(path):
        if block.language == 'sh':
            output = ''
            for name, *words in map(of_the_package, filter(runs_here, commands(block))):
                run = in_its_own_process if name in WITH_NODES else in_this_process
                output += run(name, words)
        elif block.language == 'python':
            output = printed(exec, block.text, {'__name__': '__main__'})
        elif block.language == 'text' and output:
            assert block.text in output, f'{identifier(path)}: {output}'
