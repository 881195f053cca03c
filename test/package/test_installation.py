"""`pip install .` without ROS: the library, its metadata, and executables that say in one line what they lack."""

import email
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import manta_sim_ros

ROOT = Path(__file__).parents[2]
SOURCES = ('package.xml', 'setup.py', 'setup.cfg', 'pyproject.toml', 'README.md', 'LICENSE', 'resource', 'config',
           'launch', 'rviz', 'urdf', 'manta_sim_ros')

WITHOUT = """
import importlib.abc, sys

class Lacking(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name.partition('.')[0] in {lacking!r}:
            raise ModuleNotFoundError(f'No module named {{name!r}}', name=name)

sys.meta_path.insert(0, Lacking())
"""
OF_ROS = ('rclpy', 'rcl_interfaces', 'rosgraph_msgs', 'std_msgs', 'std_srvs', 'geometry_msgs', 'nav_msgs',
          'sensor_msgs', 'diagnostic_msgs', 'visualization_msgs', 'builtin_interfaces', 'ament_index_python')


@pytest.fixture(scope='module')
def installed(tmp_path_factory):
    """The folder that pip installed the package into, from a copy of the sources."""
    folder = tmp_path_factory.mktemp('pip')
    (folder / 'sources').mkdir()
    for name in SOURCES:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / 'sources' / name, ignore=shutil.ignore_patterns('__pycache__'))
        else:
            shutil.copy(source, folder / 'sources')
    subprocess.run(
        [sys.executable, '-m', 'pip', 'install', '--quiet', '--no-deps', '--no-build-isolation', '--no-index',
         '--disable-pip-version-check', '--target', folder / 'site', folder / 'sources'], check=True, timeout=300)
    return folder / 'site'


def run(installed, folder, code, lacking=OF_ROS):
    """Run code with the installed package, in a Python that lacks some packages."""
    return subprocess.run(
        [sys.executable, '-c', WITHOUT.format(lacking=tuple(lacking)) + code], cwd=folder, capture_output=True,
        text=True, timeout=300, env={'PYTHONPATH': str(installed), 'HOME': str(folder), 'PATH': '/usr/bin:/bin'})


def test_the_metadata_name_what_the_library_needs_and_the_extras(installed):
    (path,) = installed.glob('manta_sim_ros-*.dist-info/METADATA')
    metadata = email.message_from_string(path.read_text(encoding='utf-8'))
    assert metadata['Version'] == manta_sim_ros.__version__
    needed = {line for line in metadata.get_all('Requires-Dist') if 'extra' not in line}
    assert needed == {'numba', 'numpy', 'PyYAML', 'scipy'}  # setuptools is needed to build only
    assert set(metadata.get_all('Provides-Extra')) == {'figures', 'test'}
    figures = {line.split(';')[0].strip() for line in metadata.get_all('Requires-Dist') if "'figures'" in
               line.replace('"', "'")}
    assert figures == {'matplotlib', 'pillow', 'tqdm'}
    assert (installed / 'manta_sim_ros' / 'py.typed').is_file()
    assert {path.name for path in (installed / 'bin').iterdir()} >= {
        'sim_node', 'gait_node', 'monitor_node', 'paper_figures'}


def test_the_library_works_without_ros_and_without_setuptools(installed, tmp_path):
    ended = run(installed, tmp_path, """
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator
import manta_sim_ros
gait = FinCommand(amplitude=0.7, frequency=0.6, phase=0.7)
simulator = Simulator(Parameters().replace(fin={'chains': 4}))
simulator.command(left=gait, right=gait)
print(manta_sim_ros.__file__, simulator.advance(2.0).position[0])
""", (*OF_ROS, 'setuptools', 'pkg_resources', 'matplotlib', 'tqdm'))
    assert ended.returncode == 0, ended.stderr
    path, position = ended.stdout.split()
    assert Path(path).is_relative_to(installed) and 0.05 < float(position) < 1.0  # [m]


@pytest.mark.parametrize(('executable', 'lacking', 'words'), [
    ('sim_node', OF_ROS, ['sim_node needs ROS 2', 'source its setup file']),
    ('gait_node', OF_ROS, ['gait_node needs ROS 2']),
    ('monitor_node', OF_ROS, ['monitor_node needs ROS 2']),
    ('paper_figures', ['matplotlib'], ['no module matplotlib', "pip install 'manta_sim_ros[figures]'"]),
    ('paper_figures', ['PIL'], ['no module PIL', "pip install 'manta_sim_ros[figures]'"]),
    ('paper_figures', ['tqdm'], ['no module tqdm', "pip install 'manta_sim_ros[figures]'"]),
])
def test_an_executable_that_lacks_a_package_says_so_in_one_line(installed, tmp_path, executable, lacking, words):
    ended = run(installed, tmp_path, f"""
sys.argv = [{executable!r}]
from manta_sim_ros.executables import {executable}
{executable}()
""", lacking)
    assert ended.returncode == 1 and not ended.stdout
    (line,) = ended.stderr.splitlines()  # before anything is measured
    assert line.startswith(f'{executable}: ') and all(word in line for word in words)
