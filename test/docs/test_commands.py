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
page shows and the recordings that it speaks of. Who runs the others, :func:`run_by` says.
"""

import ast
import contextlib
import importlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys

import numpy as np
import pytest

from slip_detector.scenes import find_scene, load_scene
from support.pages import PAGES, ROOT, blocks, file_name, identifier

#: For one command of a page; only ends what hangs.
PATIENCE_S = 500.0

#: Who runs what does not run here: a test, or a file and the words in it that run it. Not here are
#: the commands of ROS, which is not everywhere (then the test does the same through rclpy), what
#: runs until it is ended, and what takes long.
RUN_BY = {
    'make demo': 'Makefile: \ndemo:',
    'make grasp': 'Makefile: \ngrasp:',
    'make view': 'Makefile: \nview:',
    'make check': 'Makefile: \ncheck:',
    'make test': '.ci/run: make test',
    'make test-matrix': '.github/workflows/ci.yml: make test-matrix',
    'make benchmark': 'Makefile: \nbenchmark:',
    'make fuzz': 'Makefile: \nfuzz:',
    'make fuzz seconds=300': 'Makefile: \nfuzz:',
    'make fuzz seconds=3600': 'Makefile: \nfuzz:',
    '. .venv/bin/activate': 'Makefile: -m venv $(VENV)',
    'python test/support/parameter_tables.py': (
        'test/docs/test_docs.py::test_the_parameter_tables_are_those_of_the_dataclasses'
    ),
    'rosdep install --from-paths src --ignore-src': (
        'test/package/test_package.py::test_rosdep_knows_every_key_of_package_xml'
    ),
    'colcon build --packages-select slip_detector': '.ci/colcon: build --paths .',
    'colcon test': '.ci/colcon: test --paths .',
    '. install/setup.sh': '.ci/colcon: /local_setup.bash',
    'python3 examples/publish_voltages.py': (
        'test/examples/test_publish_voltages.py'
        '::test_a_detector_with_the_parameters_of_the_readme_tells_its_slip'
    ),
    'ros2 topic echo /slip': (
        'test/nodes/test_detector.py::test_every_topic_says_what_the_chain_decides'
    ),
    **dict.fromkeys(
        (
            'ros2 bag record',
            'ros2 bag record -o rest /voltages',
            'ros2 bag record -o slips/1 /voltages',
            'ros2 bag record -o taps /voltages',
        ),
        'test/nodes/test_demo.py::test_the_recording_is_the_trial_with_its_labels',
    ),
    'ros2 param set /slip_detector threshold 0.7': (
        'test/nodes/test_detector_parameters.py'
        '::test_a_new_threshold_holds_from_the_next_row_and_leaves_the_filters_alone'
    ),
    'ros2 param set /slip_detector passband_hz [20.0, 120.0]': (
        'test/nodes/test_detector_parameters.py'
        '::test_a_new_band_takes_over_between_two_rows_settled_on_the_rows_before'
    ),
    'ros2 param load': (
        'test/nodes/test_detector_parameters.py'
        '::test_no_sample_is_lost_while_all_parameters_are_loaded_one_by_one'
    ),
    **{
        f'ros2 lifecycle set /slip_detector {transition}': (
            'test/nodes/test_detector_lifecycle.py::test_a_manager_takes_the_node_through_its_life'
        )
        for transition in ('configure', 'activate', 'deactivate')
    },
    'ros2 run slip_detector slip_detector --fingers thumb,index,middle'
    ' --ros-args -r __ns:=/left': (
        'test/nodes/test_fingers.py'
        '::test_each_finger_has_nodes_and_parameters_of_its_own_and_all_samples_come'
    ),
    'ros2 run slip_detector slip_detector --configs onset.yaml,sure.yaml'
    ' --ros-args -r __ns:=/index': (
        'test/nodes/test_configs.py::test_each_file_is_a_detector_of_its_own_on_the_same_input'
    ),
    **dict.fromkeys(
        (
            'ros2 topic echo /onset/slip',
            'ros2 topic echo /sure/slip',
            'ros2 param set /sure/slip_detector threshold 0.2',
        ),
        'test/nodes/test_configs.py::test_each_file_is_a_detector_of_its_own_on_the_same_input',
    ),
    'ros2 run slip_detector': (
        'test/package/test_installed.py::test_every_executable_is_where_ros2_run_looks'
    ),
    'ros2 run slip_detector slip_detector': (
        'test/nodes/test_detector.py::test_every_topic_says_what_the_chain_decides'
    ),
    'ament_copyright --add-missing The slip_detector maintainers apache2'
    ' slip_detector benchmarks examples launch test': (
        'test/package/test_ament_lint.py'
        '::test_ament_copyright_finds_copyright_and_license_everywhere'
    ),
    **{
        words: f'test/nodes/test_layouts.py::test_{test}'
        for words, test in {
            'ros2 run rviz2 rviz2 -d $(ros2 pkg prefix --share slip_detector)/config/slip.rviz': (
                'rviz_subscribes_to_the_markers_as_they_are_published'
            ),
            'ros2 run plotjuggler plotjuggler --layout'
            ' $(ros2 pkg prefix --share slip_detector)/config/slip.plotjuggler.xml': (
                'plotjuggler_plots_what_is_published'
            ),
            'ros2 bag record /voltages /slip /slip_valid /slip_detector/envelope': (
                'plotjuggler_plots_what_is_published'
            ),
            'ros2 launch foxglove_bridge foxglove_bridge_launch.xml': (
                'foxglove_plots_what_is_published'
            ),
        }.items()
    },
    'ros2 run slip_detector slip_view': (
        'test/nodes/test_layouts.py::test_rviz_subscribes_to_the_markers_as_they_are_published'
    ),
    'ros2 param get /slip_detector threshold': (
        'test/nodes/test_parameters.py'
        '::test_what_was_given_is_declared_and_all_else_has_its_default'
    ),
    'ros2 launch': 'test/launch/test_launch_ends.py::test_a_signal_leaves_no_node_behind',
    'ros2 launch slip_detector slip_detector.launch.py': (
        'test/launch/test_launch_slip_detector.py::TestTopics'
    ),
    'ros2 launch slip_detector hand.launch.py': 'test/launch/test_launch_hand.py::TestTopics',
    'ros2 launch slip_detector grasp.launch.py': 'test/launch/test_launch_grasp.py::TestGrasp',
    'slip_demo --out out': 'Makefile: slip_demo --out out',
    'chromium-headless-shell --hide-scrollbars --screenshot=docs/figures/report.png'
    ' --window-size=1280,860 report.html#event-0-0-0': (
        'test/report/test_page_in_browser.py::test_it_renders'
    ),
    'slip_evaluate xela_uskin_slip --config config/xela_uskin.yaml': (
        'test/commands/test_evaluate_real_finger.py'
        '::test_the_real_finger_is_told_sliding_from_holding_and_from_moving'
    ),
    'slip_evaluate --protocol paper': (
        'test/evaluation/test_protocol.py::test_the_papers_results_are_reproduced'
    ),
    'slip_evaluate --protocol paper --plot docs/figures': (
        'test/commands/test_evaluate_protocol.py::test_the_pictures_are_written_and_show_something'
    ),
    'slip_grasp --live 30': (
        'test/nodes/test_grasp_demo.py'
        '::test_the_objects_are_held_and_those_through_the_nodes_slide_as_in_simulated_time'
    ),
    'slip_grasp --seeds 7000:7029 --out out': (
        'test/nodes/test_grasp_demo.py'
        '::test_the_objects_are_held_and_those_through_the_nodes_slide_as_in_simulated_time'
    ),
    **dict.fromkeys(
        (
            'dask scheduler',
            'dask worker tcp://HOST:8786 --nworkers 16 --nthreads 1',
            'slip_evaluate /data/recordings --cluster tcp://HOST:8786 --json',
            'slip_tune /data/sample --cluster tcp://HOST:8786 --out detector.yaml',
        ),
        'test/commands/test_cluster.py'
        '::test_a_cluster_finds_the_same_to_the_bit_though_workers_die',
    ),
    **{
        f'slip_evaluate trial.mcap --topic {topic} --field {field}': (
            'test/recordings/test_bag_recording.py'
            '::test_any_message_type_is_read_by_topic_and_field'
        )
        for topic, field in (
            ('/biotac', 'tactiles[0].pac'),
            ('/hub_0/sensor_0', 'pillars[].fz'),
        )
    },
}

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
    'make',
    'ros2',
    'python',
    'python3',
    'pip',
    'colcon',
    'rosdep',
    'chromium-headless-shell',
} | set(SCRIPTS)


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
    return ' '.join(words) not in RUN_BY and bool(of_the_package(words))


def launch_arguments(name):
    """Return what a launch file declares, and those that it includes."""
    text = (ROOT / 'launch' / name).read_text(encoding='utf-8')
    declared = set(re.findall(r"DeclareLaunchArgument\(\s*'(\w+)'", text))
    return declared.union(*map(launch_arguments, re.findall(r"'(\w+\.launch\.py)'", text)))


def run_by(words):
    """Return the key of :data:`RUN_BY` for a command; fail where its arguments are not right."""
    if words[:3] == ['ros2', 'launch', 'slip_detector']:
        declared = launch_arguments(words[3])
        assert {word.split(':=')[0] for word in words[4:]} <= declared, words
        return ' '.join(words[:4])
    if words[:3] == ['python', '-m', 'benchmarks']:
        if len(words) > 3:
            makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
            assert re.search(rf'for command in [^;]*\b{words[3]}\b', makefile), words
            command = importlib.import_module(f'benchmarks.{words[3]}.command')
            command.options().parse_args(words[4:])
        return 'make benchmark'
    if words[:2] == ['pip', 'install']:
        # What pip is told to install is what the package says that it may need.
        setup = (ROOT / 'setup.py').read_text(encoding='utf-8')
        for name in words[2:]:
            assert name.startswith('--') or re.search(rf"'{name}[><=']", setup), name
        return 'make demo'
    return ' '.join(words)


@pytest.mark.parametrize('path', PAGES, ids=identifier)
def test_each_command_is_run_by_a_test_or_a_benchmark(path):
    elsewhere = [words for words in commands_in_blocks(path) if not runs_here(words)]
    run_here = [words for page in PAGES for words in commands_in_blocks(page) if runs_here(words)]
    elsewhere += [words for words in commands_in_text(path) if words not in run_here]
    not_run = [words for words in elsewhere if run_by(words) not in RUN_BY]
    assert not not_run


def test_who_runs_a_command_is_there_and_nobody_is_named_for_nothing():
    for where in RUN_BY.values():
        if '::' in where:
            file, _, name = where.partition('::')
            tree = ast.parse((ROOT / file).read_text(encoding='utf-8'))
            assert name in {getattr(node, 'name', None) for node in tree.body}, where
        else:
            file, _, words = where.partition(': ')
            assert words in (ROOT / file).read_text(encoding='utf-8'), where
    named = [
        run_by(words)
        for path in PAGES
        for words in commands_in_blocks(path) + commands_in_text(path)
    ]
    assert set(RUN_BY) <= set(named)


def test_a_command_that_nobody_runs_is_seen(tmp_path):
    page = tmp_path / 'page.md'
    page.write_text('`make coffee`, `slip_tune`:\n\n```sh\nros2 topic hz /slip  # often\n```\n')
    assert commands_in_text(page) == [['make', 'coffee']]
    assert commands_in_blocks(page) == [['ros2', 'topic', 'hz', '/slip']]
    for words in commands_in_text(page) + commands_in_blocks(page):
        assert not runs_here(words)
        assert run_by(words) not in RUN_BY


def pages_to_run():
    """Yield each page with something to run; what starts nodes is marked so."""
    for path in PAGES:
        here = [of_the_package(words)[0] for words in commands_in_blocks(path) if runs_here(words)]
        if here or any(block.language == 'python' for block in blocks(path)):
            marks = [pytest.mark.nodes] if WITH_NODES & set(here) else []
            yield pytest.param(path, id=identifier(path), marks=marks)


def printed(call):
    """Return what a call prints."""
    with contextlib.redirect_stdout(io.StringIO()) as output:
        call()
    return output.getvalue()


def in_this_process(name, words):
    """Return what a command prints; its modules are loaded once so, and not for each command."""
    module, function = SCRIPTS[name]
    start = getattr(importlib.import_module(f'slip_detector.{module}'), function)

    def run():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, 'argv', [name, *words])
            assert start() == 0, ' '.join((name, *words))

    return printed(run)


def in_its_own_process(name, words):
    """Return what a command with nodes prints."""
    module, function = SCRIPTS[name]
    code = f'import sys; from slip_detector.{module} import {function}; sys.exit({function}())'
    done = subprocess.run(
        [sys.executable, '-c', code, *words],
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0, f'{name} {" ".join(words)}:\n{done.stderr}'
    return done.stdout


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """Recordings with slip, and one without, which pages call ``bags``."""
    folder = tmp_path_factory.mktemp('recorded')
    for scene_name in ('plate_400um', 'plate_440um', 'taps'):
        scene = load_scene(find_scene(scene_name), np.random.default_rng(0))
        samples = scene.read(10_000)
        np.savez(
            folder / f'{scene_name}.npz',
            volts=samples.volts,
            slip=samples.truth,
            sample_rate_hz=scene.sample_rate_hz,
        )
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
            output = printed(lambda code=block.text: exec(code, {'__name__': '__main__'}))
        elif block.language == 'text' and output:
            assert block.text in output, f'{identifier(path)}: {output}'
