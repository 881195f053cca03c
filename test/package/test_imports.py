"""Each folder imports only what CONTRIBUTING.md allows it; the library needs Numba, NumPy and PyYAML."""

import ast
import sys
from pathlib import Path

import pytest

from evidence.scenarios import run_python

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / 'manta_sim_ros'
LIBRARY = PACKAGE / 'dynamics'
ALLOWED = {'numba', 'numpy', 'yaml'}
OF_ROS = {'rclpy', 'rcl_interfaces', 'rosgraph_msgs', 'std_msgs', 'std_srvs', 'geometry_msgs', 'nav_msgs',
          'sensor_msgs', 'diagnostic_msgs', 'visualization_msgs', 'tf2_msgs', 'builtin_interfaces',
          'simulation_interfaces', 'ament_index_python', 'rpyutils'}
SHARED = ['manta_sim_ros.dynamics', 'manta_sim_ros.sensors', 'manta_sim_ros.body_shape', 'manta_sim_ros.signals']

IMPORT = """
import sys
before = set(sys.modules)
import manta_sim_ros.dynamics
print(*sorted({name.partition('.')[0] for name in set(sys.modules) - before}))
"""


def sources(*folders):
    return [pytest.param(path, id=str(path.relative_to(ROOT)))
            for folder in folders for path in sorted((ROOT / folder).rglob('*.py')) if '__pycache__' not in path.parts]


def imported(path):
    """Return the names of all modules that a file imports, those of `from manta_sim_ros import ...` too."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, 'a relative import'
            top = node.module == 'manta_sim_ros'
            names += [f'{node.module}.{alias.name}' for alias in node.names] if top else [node.module]
    return names


def tops(path):
    return {name.partition('.')[0] for name in imported(path)}


def within(name, modules):
    return any((name + '.').startswith(module + '.') for module in modules)


def test_the_import_of_the_library_pulls_in_nothing_of_ros(tmp_path):
    names = run_python(IMPORT, tmp_path).stdout.split()
    assert {'manta_sim_ros', *ALLOWED} <= set(names)
    assert not set(names) & {*OF_ROS, 'matplotlib'}


def test_the_papers_figures_need_nothing_of_ros(tmp_path):
    code = IMPORT.replace('manta_sim_ros.dynamics', 'manta_sim_ros.figures.command')
    names = run_python(code, tmp_path).stdout.split()
    assert {'manta_sim_ros', 'tqdm'} <= set(names)
    assert not set(names) & OF_ROS


@pytest.mark.parametrize('module', [
    'studies.identify', 'studies.linearize', 'studies.sweep', 'control.closed_loop', 'control.design',
    'control.teleoperation', 'learning.command'])
def test_these_studies_and_control_need_nothing_of_ros(module, tmp_path):
    names = run_python(IMPORT.replace('manta_sim_ros.dynamics', f'manta_sim_ros.{module}'), tmp_path)
    assert not set(names.stdout.split()) & OF_ROS


@pytest.mark.parametrize('path', sources('manta_sim_ros/dynamics'))
def test_every_import_of_the_library_is_of_itself_or_allowed(path):
    for name in imported(path):
        top = name.partition('.')[0]
        assert top in sys.stdlib_module_names or top in ALLOWED or within(name, ['manta_sim_ros.dynamics'])


@pytest.mark.parametrize('path', sources('manta_sim_ros'))
def test_the_package_imports_as_its_folders_say(path):
    rooms = {'nodes': [*SHARED, 'manta_sim_ros.control', 'manta_sim_ros.nodes'],
             'control': [*SHARED, 'manta_sim_ros.control', 'manta_sim_ros.studies', 'manta_sim_ros.figures'],
             'learning': [*SHARED, 'manta_sim_ros.learning', 'manta_sim_ros.studies'],
             'figures': [*SHARED, 'manta_sim_ros.figures'],
             'dynamics': ['manta_sim_ros.dynamics'], 'studies': ['manta_sim_ros']}
    room = path.relative_to(PACKAGE).parts[0]
    names = imported(path)
    assert room in ('nodes', 'studies') or not tops(path) & OF_ROS
    assert not tops(path) & {'evidence', 'test'}
    for name in names:
        if within(name, ['manta_sim_ros']):
            assert within(name, rooms.get(room, SHARED)), name
            assert room == 'dynamics' or not within(name, ['manta_sim_ros.dynamics']) or (
                name == 'manta_sim_ros.dynamics'), f'{name}: public names are imported from manta_sim_ros.dynamics'


@pytest.mark.parametrize('path', sources('manta_sim_ros', 'evidence', 'test', 'examples', 'launch'))
def test_nothing_imports_from_the_tests_or_changes_the_path(path):
    assert not tops(path) & {'test', 'conftest'}
    attributes = [node for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
                  if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)]
    assert not any((node.value.id, node.attr) == ('sys', 'path') for node in attributes)


@pytest.mark.parametrize('path', sources('examples'))
def test_examples_import_public_names(path):
    names = [name for name in imported(path) if within(name, ['manta_sim_ros', 'evidence'])]
    assert set(names) <= {'manta_sim_ros.dynamics'}


def test_every_public_name_of_the_library_has_its_path_in_the_reference():
    import manta_sim_ros.dynamics as library

    page = (ROOT / 'docs' / 'library.md').read_text(encoding='utf-8')
    public = {name for name in vars(library) if not name.startswith('_')
              and getattr(vars(library)[name], '__name__', '') != f'manta_sim_ros.dynamics.{name}'}
    assert set(library.__all__) == public
    assert '::: manta_sim_ros.dynamics' in page
