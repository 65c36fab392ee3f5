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

"""What is written twice, in files that different tools read, says the same."""

import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from package.imported_names import imported_names

from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.sections import SECTIONS, set_of
from slip_detector.parameters.yaml_files import read_yaml

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted((ROOT / 'slip_detector').rglob('*.py'))
CONFIGS = sorted((ROOT / 'config').glob('*.yaml')) + sorted((ROOT / 'config').glob('sensors/*'))
LAUNCH_FILES = sorted((ROOT / 'launch').glob('*.launch.py'))

#: Packages of Ubuntu: the key of each is its name after ``python3-``.
OF_UBUNTU = {'matplotlib', 'numba', 'numpy', 'scipy', 'serial', 'tornado', 'tqdm', 'yaml'}

#: What only PyPI has (see rosdep_keys.txt): what needs it says how to install it. And llvmlite,
#: which comes with Numba.
WITHOUT_KEY = {'llvmlite', 'optuna', 'rosbags'}


def package_xml():
    return ElementTree.parse(ROOT / 'package.xml').getroot()


def test_package_xml_names_every_dependency_and_no_other():
    tags = ('depend', 'exec_depend')
    declared = {element.text for tag in tags for element in package_xml().findall(tag)}
    names = set().union(*map(imported_names, [*SOURCES, *LAUNCH_FILES]))
    # Only type checkers import typing_extensions.
    not_declared = {'slip_detector', 'typing_extensions', *sys.stdlib_module_names}
    used = {name.partition('.')[0] for name in names} - not_declared
    assert used >= WITHOUT_KEY
    keys = {f'python3-{name}' if name in OF_UBUNTU else name for name in used - WITHOUT_KEY}
    assert keys == declared


def test_rosdep_knows_every_key_of_package_xml():
    lines = (Path(__file__).parent / 'rosdep_keys.txt').read_text().splitlines()
    known = {line for line in lines if line and not line.startswith('#')}
    keys = {element.text for element in package_xml() if element.tag.endswith('depend')}
    assert len(keys) > 10
    assert keys <= known, 'look it up as rosdep_keys.txt says, then add it there'


def test_the_package_is_installed_without_tests_and_benchmarks(tmp_path):
    command = [sys.executable, 'setup.py', '--quiet', 'build_py', '--build-lib', str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True)
    built = {path.relative_to(tmp_path) for path in tmp_path.rglob('*') if path.is_file()}
    package = ROOT / 'slip_detector'
    templates = (package / 'report' / 'templates').rglob('*.*')
    page = (package / 'view' / 'page').rglob('*.*')
    assert built == {path.relative_to(ROOT) for path in (*SOURCES, *templates, *page)}


def test_package_xml_and_setup_py_agree():
    setup = (ROOT / 'setup.py').read_text()
    for tag in ('version', 'description', 'license'):
        assert f"{tag}='{package_xml().findtext(tag)}'" in setup
    assert f"NAME = '{package_xml().findtext('name')}'" in setup
    assert package_xml().find('maintainer').get('email') in setup
    version = package_xml().findtext('version')
    assert re.search(rf'^{version} ', (ROOT / 'CHANGELOG.rst').read_text(), re.M)


def test_the_presets_that_run_beside_one_driver_take_the_same_samples():
    onset, sure, plain = (
        ChainConfig.from_yaml(ROOT / 'config' / f'{name}.yaml')
        for name in ('onset', 'sure', 'slip_detector')
    )
    for name in ('sample_rate_hz', 'channels', 'channel_names', 'groups'):
        assert getattr(onset, name) == getattr(sure, name) == getattr(plain, name)


@pytest.mark.parametrize('path', CONFIGS, ids=lambda p: p.name)
def test_every_shipped_parameter_file_is_taken(path):
    for parameter_set in map(set_of, SECTIONS):
        parameter_set.from_yaml(path)
    # A section for a name that no node has would be ignored in silence.
    sections = {section.rsplit('/', 1)[-1] for section in read_yaml(path)}
    assert sections <= set(SECTIONS)
