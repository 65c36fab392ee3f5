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

"""Build the ament_python package."""

from glob import glob

from setuptools import find_packages, setup

NAME = 'slip_detector'


def ros_wheels(distribution: str) -> list[str]:
    """List the wheels that stand in for a ROS 2 installation on a bare machine."""
    packages = (
        *('rclpy', 'rmw-fastrtps-cpp', 'std-msgs', 'sensor-msgs', 'diagnostic-msgs'),
        'visualization-msgs',
    )
    return [f'ros-{distribution}-{package}' for package in packages]


setup(
    name=NAME,
    version='0.7.0',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={
        f'{NAME}.report': ['templates/*', 'templates/uplot/*'],
        f'{NAME}.view': ['page/*'],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/launch', glob('launch/*.launch.py')),
        (f'share/{NAME}/config', glob('config/*.*')),
        (f'share/{NAME}/config/scenes', glob('config/scenes/*.yaml')),
        (f'share/{NAME}/config/sensors', glob('config/sensors/*.yaml')),
        (f'share/{NAME}/examples', glob('examples/*.*')),
    ],
    python_requires='>=3.10',
    install_requires=[
        'setuptools',
        'numpy>=1.26',
        'scipy>=1.11',
        'pyyaml',
        'matplotlib',
        'pyserial>=3.5',
        'tornado>=6.1',
        'tqdm',
    ],
    extras_require={
        # A robot may lack Numba: the chain then runs interpreted.
        'numba': ['numba>=0.58'],
        # It reads and writes bags; npz and csv need none of it.
        'bags': ['rosbags>=0.11'],
        'ros': ros_wheels('jazzy'),
        'ros-kilted': ros_wheels('kilted'),
        'tune': ['optuna>=5.0'],
        'test': [
            'axe-core-python',
            'colcon-common-extensions',
            'hypothesis',
            'mpmath>=1.2',
            'mypy',
            # It looks at the JavaScript of the pages.
            'oxlint',
            'playwright',
            # The launch_testing of Jazzy, where a ROS installation brings it, stops pytest 9
            # before any test (launch 3.4.12 no longer does).
            'pytest>=7.4,<9',
            'pytest-timeout',
            'pytest-xdist',
            # With it rosbags reads and writes the YAML in a bag in half the time.
            'ruamel.yaml.clib',
            'ruff',
            'types-PyYAML',
            'types-pyserial',
            'types-tqdm',
        ],
    },
    zip_safe=True,
    author='The slip_detector maintainers',
    maintainer='The slip_detector maintainers',
    maintainer_email='maintainers@slip-detector.invalid',
    description='ON/OFF slip from the raw voltages of tactile fingertips',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            f'slip_driver = {NAME}.nodes.run:driver',
            f'slip_detector = {NAME}.nodes.run:detector',
            f'grasp_controller = {NAME}.nodes.run:grasp_controller',
            f'slip_view = {NAME}.nodes.run:view',
            f'slip_demo = {NAME}.nodes.run:demo',
            f'slip_grasp = {NAME}.nodes.run:grasp',
            f'slip_evaluate = {NAME}.commands.command_line:evaluate',
            f'slip_tune = {NAME}.commands.command_line:tune',
            f'slip_compile = {NAME}.commands.command_line:compile_all',
        ],
    },
)
