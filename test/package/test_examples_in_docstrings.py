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

"""Each public function and class has an example that runs, or a reason to have none."""

import ast

from support.pages import ROOT

PACKAGE = ROOT / 'slip_detector'

#: Why what is named by file and name has no example.
REASONS = {
    'arrays and numbers that only compiled code takes, made by the parts that they describe': {
        'chain/plan.py': {'Layout', 'Parts', 'Scratch', 'Settings', 'plan_of'},
        'chain/stamps.py': {'MendedSamples'},
        'evaluation/matching.py': {'RowInterval'},
        'scenes/constants.py': {'scene_constants'},
        'scenes/contact.py': {'HertzNumbers'},
        'scenes/drive.py': {'Drive', 'DriveNumbers'},
        'scenes/disturbances.py': {'Sines', 'TapNumbers'},
        'scenes/friction.py': {'FrictionNumbers', 'SkinNumbers'},
        'scenes/mechanics.py': {'SceneConstants', 'State'},
        'scenes/motion.py': {'ForceNumbers', 'LoadNumbers', 'PlateNumbers', 'held_force'},
        'scenes/rolling.py': {'RollingNumbers'},
        'scenes/texture.py': {'RidgeNumbers', 'RoughNumbers'},
    },
    'it compiles': {
        'chain/compiled.py': {'as_silent', 'compiled', 'compiled_for', 'compiled_in_place'},
        'chain/kernel.py': {'kernel'},
        'commands/compile.py': {'compile_all'},
    },
    'a command, which README and docs show and test/docs runs': {
        'commands/command_line.py': {'compile_all', 'evaluate', 'tune'},
        'commands/compile.py': {'main'},
        'commands/evaluate.py': {'main'},
        'commands/tune.py': {'main'},
    },
    'one step of a command, which takes its options or all of its results': {
        'commands/evaluate.py': {'as_report'},
        'tuning/learning.py': {'learn_from_quiet', 'learn_from_taps'},
        'evaluation/protocol.py': {'claims', 'run_protocol'},
        'evaluation/replay.py': {'Observer'},
        'report/evaluation_report.py': {'overview_factory'},
        'report/grasp_picture.py': {'draw_grasp'},
        'report/page_data.py': {'choose_snippets'},
        'report/protocol_pictures.py': {'draw_protocol'},
        'report/protocol_table.py': {'protocol_table'},
        'report/tuning_report.py': {'ChainReplay', 'write_tuning_report'},
        'tuning/objective.py': {'Candidate'},
        'tuning/search.py': {'FileObjective', 'TuningResult', 'tune'},
        'tuning/tracks.py': {'TrainingFiles'},
    },
    'a step of reading or writing a bag, as the example of BagRecording does': {
        'recordings/bag_storage.py': {'BagStorage'},
        'recordings/damaged_database.py': {'DamagedDatabase'},
        'recordings/damaged_mcap.py': {'DamagedMcap'},
        'recordings/mcap_chunks.py': {'survey', 'write_checksums'},
    },
    'it serves a page or listens to a finger': {
        'view/detectors.py': {'Detectors'},
        'view/parameter_requests.py': {'ParameterRequests'},
        'view/recorded_folder.py': {'Recorder'},
        'view/server.py': {'File', 'LivePage', 'Server'},
        'view/teaching.py': {'Teaching'},
        'view/teaching_requests.py': {'TeachingRequests'},
        'view/tune_run.py': {'TuneRun'},
    },
}


def public_objects():
    """Yield file, syntax tree and whether the file needs rclpy, of each public object."""
    for path in sorted(PACKAGE.rglob('*.py')):
        file = ast.parse(path.read_text(encoding='utf-8'))
        imported = {
            (node.module or '').partition('.')[0]
            for node in ast.walk(file)
            if isinstance(node, ast.ImportFrom)
        } | {
            alias.name.partition('.')[0]
            for node in ast.walk(file)
            if isinstance(node, ast.Import)
            for alias in node.names
        }
        for node in file.body:
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and node.name[0] != '_':
                yield path.relative_to(PACKAGE).as_posix(), node, 'rclpy' in imported


def has_example(node):
    """Return whether the docstring, or that of a method, has an example."""
    methods = [each for each in node.body if isinstance(each, ast.FunctionDef)]
    return any('>>>' in (ast.get_docstring(each) or '') for each in [node, *methods])


def is_compiled(node):
    """Return whether it is a step of a kernel, which works on the memory of that."""
    return any(ast.unparse(each).startswith('compiled') for each in node.decorator_list)


def test_each_public_object_has_an_example_or_a_reason_to_have_none():
    without = {
        f'{path}: {node.name}'
        for path, node, needs_rclpy in public_objects()
        if not has_example(node) and not is_compiled(node)
        # Its file is of a node, whose tests start it.
        if not needs_rclpy and not (path.startswith('nodes/') and node.name == 'main')
    }
    excused = {
        f'{path}: {name}'
        for files in REASONS.values()
        for path, names in files.items()
        for name in names
    }
    assert without - excused == set()
    assert excused - without == set()
