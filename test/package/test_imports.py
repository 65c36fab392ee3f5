"""What may import what."""

import functools
import pkgutil
import subprocess
import sys

import pytest

import slip_detector

CORE = tuple(
    sorted(
        module.name
        for module in pkgutil.walk_packages(slip_detector.__path__, 'slip_detector.')
        if not module.name.startswith('slip_detector.nodes')
    )
)
NODES = tuple(
    f'slip_detector.nodes.{name}' for name in ('detector', 'driver', 'grasp_controller', 'run')
)

WITHOUT = """
import importlib, sys
for name in {absent!r}:
    sys.modules[name] = None
for name in {modules!r}:
    importlib.import_module(name)
print(*sorted(sys.modules))
"""


@functools.cache
def loaded_by(modules, absent=()):
    """Import the modules in a new interpreter and return all that came with them."""
    code = WITHOUT.format(modules=modules, absent=absent)
    done = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_only_nodes_import_rclpy_and_messages():
    ros = ('rclpy', 'std_msgs', 'sensor_msgs', 'rcl_interfaces', 'builtin_interfaces')
    ros += ('diagnostic_msgs', 'lifecycle_msgs')
    assert len(CORE) >= 10
    loaded_by(CORE, absent=ros)


def test_the_nodes_do_without_plotting():
    pytest.importorskip('rclpy', reason='needs rclpy')
    assert 'matplotlib' not in loaded_by(NODES)


def test_the_nodes_load_pyserial_only_for_a_serial_port():
    pytest.importorskip('rclpy', reason='needs rclpy')
    assert 'serial' not in loaded_by(NODES)


def test_the_nodes_do_without_reports():
    pytest.importorskip('rclpy', reason='needs rclpy')
    of_reports = {f'slip_detector.report.{name}' for name in ('overview', 'page', 'page_data')}
    assert of_reports < set(CORE)
    assert of_reports.isdisjoint(loaded_by(NODES))


def test_only_the_report_imports_a_plotting_library():
    others = tuple(name for name in CORE if not name.startswith('slip_detector.report.'))
    loaded_by(others, absent=('matplotlib',))


def test_the_chain_is_offered_by_the_package_and_loads_nothing_that_it_does_not_need():
    code = 'import sys; from slip_detector import SlipChain, ChainConfig; print(*sys.modules)'
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    loaded = {name.split('.')[0] for name in done.stdout.split()}
    assert {'slip_detector', 'numpy', 'scipy'} <= loaded
    assert loaded.isdisjoint({'rclpy', 'std_msgs', 'matplotlib', 'optuna', 'rosbags'})
    # Only what designs a filter for the first time needs it, see chain/design_cache.py.
    assert 'scipy.signal' not in done.stdout.split()


def test_only_bags_need_what_reads_them():
    loaded = loaded_by(CORE, absent=('rosbags', 'lz4'))
    assert 'slip_detector.recordings.bag_recording' in loaded
    of_recordings = loaded_by(('slip_detector.recordings',))
    assert 'slip_detector.recordings.npz_recording' in of_recordings
    assert 'slip_detector.recordings.bag_recording' not in of_recordings
    assert 'rosbags' not in loaded_by(CORE)
