"""`pip install .` without ROS, and `scripts/setup.sh` where it is refused or beside a ROS 2 that lacks Numba."""

import email
import os
import shutil
import subprocess
import sys
import zipfile
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
    folder = tmp_path_factory.mktemp('pip install')  # a path with a space
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
    assert set(metadata.get_all('Provides-Extra')) == {'cluster', 'control', 'figures', 'learn', 'studies', 'test'}
    figures = {line.split(';')[0].strip() for line in metadata.get_all('Requires-Dist') if "'figures'" in
               line.replace('"', "'")}
    assert figures == {'matplotlib', 'pillow', 'tqdm'}
    assert (installed / 'manta_sim_ros' / 'py.typed').is_file()
    assert {path.name for path in (installed / 'bin').iterdir()} >= {
        'sim_node', 'gait_node', 'monitor_node', 'paper_figures', 'identify', 'linearize', 'path_follower',
        'averaged_model', 'mpc_follower', 'path_gains', 'report', 'simulate', 'sweep', 'teleop', 'track_node',
        'train_policy'}


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
    path, position = ended.stdout.rsplit(maxsplit=1)
    assert Path(path).is_relative_to(installed) and 0.05 < float(position) < 1.0  # [m]


@pytest.mark.parametrize(('executable', 'lacking', 'words'), [
    ('sim_node', OF_ROS, ['sim_node needs ROS 2', 'source its setup file']),
    ('gait_node', OF_ROS, ['gait_node needs ROS 2']),
    ('monitor_node', OF_ROS, ['monitor_node needs ROS 2']),
    ('teleop', OF_ROS, ['teleop needs ROS 2']),
    ('track_node', ['matplotlib'], ['no module matplotlib', "pip install 'manta_sim_ros[figures]'"]),
    ('simulate', OF_ROS, ["pip install 'manta_sim_ros[studies]'", 'source its setup file']),
    ('report', ['plotly'], ['no module plotly', "pip install 'manta_sim_ros[studies]'"]),
    ('simulate', ['rosbags'], ['no module rosbags', "pip install 'manta_sim_ros[studies]'"]),
    ('paper_figures', ['matplotlib'], ['no module matplotlib', "pip install 'manta_sim_ros[figures]'"]),
    ('paper_figures', ['PIL'], ['no module PIL', "pip install 'manta_sim_ros[figures]'"]),
    ('paper_figures', ['tqdm'], ['no module tqdm', "pip install 'manta_sim_ros[figures]'"]),
    ('mpc_follower', ['casadi'], ['no module casadi', "pip install 'manta_sim_ros[control]'"]),
    ('report', ['mcap'], ['no module mcap', "pip install 'manta_sim_ros[studies]'"]),
    ('identify', ['rosbags'], ['no module rosbags', "pip install 'manta_sim_ros[studies]'"]),
    ('train_policy', ['gymnasium'], ['no module gymnasium', "pip install 'manta_sim_ros[learn]'"]),
    ('train_policy', ['cma'], ['no module cma', "pip install 'manta_sim_ros[learn]'"]),
    ('sweep', ['pyarrow'], ['no module pyarrow', "pip install 'manta_sim_ros[studies]'"]),
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


@pytest.fixture
def setup_in(tmp_path):
    """Return a function that runs `scripts/setup.sh` in a folder of this name, with `requirements/python.txt` only."""
    def start(name, *arguments, requirement='', **environment):
        folder = tmp_path / name
        (folder / 'scripts').mkdir(parents=True)
        (folder / 'requirements').mkdir()
        shutil.copy(ROOT / 'scripts' / 'setup.sh', folder / 'scripts')
        for file, content in (('python', requirement), ('build', ''), ('constraints', '')):
            (folder / 'requirements' / f'{file}.txt').write_text(content, encoding='utf-8')
        inherited = {name: value for name, value in os.environ.items() if name not in ('PYTHONPATH', 'ROS_DISTRO')}
        return folder, subprocess.run(
            [folder / 'scripts' / 'setup.sh', *arguments], capture_output=True, text=True, timeout=300,
            env=inherited | environment)

    return start


@pytest.mark.parametrize(('name', 'words'), [
    ('my robots', 'must have no spaces'), ('a\nb', 'must have no spaces'), ('a:b', 'none of : ;'),
    ('a;b', 'none of : ;'), ('*', 'none of : ;'), ('$HOME', 'none of : ;'), ('a' * 221, 'must have at most 220')])
def test_setup_refuses_a_path_that_shebangs_or_colcon_cannot_take_before_it_begins(setup_in, name, words):
    folder, ended = setup_in(name)
    assert ended.returncode == 1 and not ended.stdout
    (line,) = ended.stderr.splitlines()
    assert line.startswith('manta_sim_ros: the path of the repository ') and line.endswith(': move it')
    assert words in line
    assert sorted(path.name for path in folder.iterdir()) == ['requirements', 'scripts']  # nothing was made


def test_setup_installs_what_a_sourced_ros_lacks_beside_its_packages(setup_in, tmp_path):
    """Ubuntu 24.04 has no package for Numba, and its pip installs nothing outside a virtual environment (PEP 668)."""
    sourced, wheels = tmp_path / 'ros', tmp_path / 'wheels'
    (sourced / 'numpy-1.26.4.dist-info').mkdir(parents=True)
    (sourced / 'numpy-1.26.4.dist-info' / 'METADATA').write_text(
        'Metadata-Version: 2.1\nName: numpy\nVersion: 1.26.4\n', encoding='utf-8')
    (sourced / 'numpy.py').write_text("__version__ = '1.26.4'\n", encoding='utf-8')
    (sourced / 'rclpy.py').touch()
    wheels.mkdir()
    made_wheel(wheels, 'missing_package', '1.0', 'numpy>=1.22')
    made_wheel(wheels, 'numpy', '2.0', None)  # the messages of the sourced ROS 2 could not be loaded with it
    folder, ended = setup_in(
        'beside', '--no-build', '--', 'python', '-c',
        'import missing_package, numpy, rclpy, sys; print(numpy.__version__, sys.prefix)',
        requirement='missing_package==1.0\nnumpy==2.0\n',
        ROS='jazzy', ROS_DISTRO='jazzy', PYTHONPATH=str(sourced), PIP_NO_INDEX='1', PIP_FIND_LINKS=str(wheels))
    assert ended.returncode == 0, ended.stderr
    *_, line = ended.stdout.splitlines()
    assert line == f'1.26.4 {folder / ".venv-jazzy"}'
    assert 'on top of the sourced ROS 2 jazzy' in ended.stdout
    settings = (folder / '.venv-jazzy' / 'pyvenv.cfg').read_text(encoding='utf-8')
    assert 'include-system-site-packages = true' in settings


def made_wheel(folder, name, version, requirement):
    """Write a wheel of one empty module."""
    metadata = f'Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n'
    metadata += f'Requires-Dist: {requirement}\n' if requirement else ''
    about = f'{name}-{version}.dist-info'
    with zipfile.ZipFile(folder / f'{name}-{version}-py3-none-any.whl', 'w') as wheel:
        wheel.writestr(f'{name}.py', f"__version__ = '{version}'\n")
        wheel.writestr(f'{about}/METADATA', metadata)
        wheel.writestr(f'{about}/WHEEL', 'Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n')
        wheel.writestr(f'{about}/RECORD', '')
