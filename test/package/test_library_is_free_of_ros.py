"""The library needs Numba, NumPy and PyYAML, and nothing of ROS 2."""

import ast
import sys

import pytest

from evidence.scenarios import PACKAGE_ROOT, run_python

LIBRARY = PACKAGE_ROOT / 'manta_sim_ros' / 'dynamics'
ALLOWED = {'numba', 'numpy', 'yaml'}

IMPORT = """
import sys
before = set(sys.modules)
import manta_sim_ros.dynamics
print(*sorted({name.partition('.')[0] for name in set(sys.modules) - before}))
"""
OF_ROS = ('rclpy', 'rcl_interfaces', 'rosgraph_msgs', 'std_msgs', 'geometry_msgs', 'nav_msgs', 'builtin_interfaces',
          'ament_index_python', 'rpyutils')


def test_the_import_of_the_library_pulls_in_nothing_of_ros(tmp_path):
    imported = run_python(IMPORT, tmp_path).stdout.split()
    assert {'manta_sim_ros', *ALLOWED} <= set(imported)
    assert not set(imported) & set(OF_ROS)


def test_the_papers_figures_need_nothing_of_ros(tmp_path):
    code = IMPORT.replace('manta_sim_ros.dynamics', 'manta_sim_ros.figures.command')
    imported = run_python(code, tmp_path).stdout.split()
    assert {'manta_sim_ros', 'tqdm'} <= set(imported)
    assert not set(imported) & set(OF_ROS)


@pytest.mark.parametrize('path', sorted(LIBRARY.rglob('*.py')), ids=lambda path: path.name)
def test_every_import_of_the_library_is_of_itself_or_allowed(path):
    imported = []
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            imported.append(node.module)
    for name in imported:
        top = name.partition('.')[0]
        assert top in sys.stdlib_module_names or top in ALLOWED or (name + '.').startswith('manta_sim_ros.dynamics.')
