"""The container recipe names what is there. No container is built here: see docs/container.md."""

import re
import shlex
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).parents[2]
RECIPE = re.sub(r'^#.*\n', '', (ROOT / 'Dockerfile').read_text(encoding='utf-8'), flags=re.MULTILINE)
INSTRUCTIONS = [tuple(line.split(maxsplit=1)) for line in RECIPE.replace('\\\n', ' ').splitlines() if line.strip()]
PACKAGES = ElementTree.parse(ROOT / 'package.xml')


def instructions(name):
    return [rest for each, rest in INSTRUCTIONS if each == name]


@pytest.fixture(scope='module')
def copied():
    """The paths of the repository that the image is made from."""
    paths = [path for rest in instructions('COPY') if '--from' not in rest for path in shlex.split(rest)[:-1]]
    assert len(paths) == len(set(paths))
    return set(paths)


def test_what_is_copied_is_in_the_repository_and_is_all_that_the_package_is_made_of(copied):
    assert all((ROOT / path).exists() for path in copied)
    setup = (ROOT / 'scripts' / 'setup.sh').read_text(encoding='utf-8')
    built = set(re.search(r'find (package\.xml .*?) \\\n', setup)[1].split())
    assert copied == built | {'LICENSE', 'requirements/python.txt'}


def test_what_is_copied_is_what_is_not_ignored(copied):
    lines = (ROOT / '.dockerignore').read_text(encoding='utf-8').splitlines()
    rules = [line for line in lines if line and not line.startswith('#')]
    assert rules[0] == '*'
    assert {rule[1:] for rule in rules if rule.startswith('!')} == copied
    assert {'**/__pycache__', '**/*.nbc', '**/*.nbi'} == {rule for rule in rules[1:] if not rule.startswith('!')}


def test_what_is_installed_is_what_package_and_setup_declare():
    declared = {element.text for element in PACKAGES.iter('exec_depend')}
    stages = RECIPE.split('FROM ')[1:]
    build, final = ([
        name for command in re.findall(r'apt-get install ([^&]*)', stage) for name in shlex.split(
            command.replace('\\\n', ' ')) if not name.startswith('-')] for stage in stages)
    assert set(build) - set(final) == {'python3-venv'}
    ros = {name.removeprefix('ros-$ROS_DISTRO-').replace('-', '_') for name in final if name.startswith('ros-')}
    assert ros and ros <= declared
    python = {name for name in final if name.startswith('python3-')}
    assert python and python <= declared
    # rclpy, its messages and launch bring NumPy and PyYAML; no package of Ubuntu 24.04 brings Numba
    of_pip = re.findall(r"grep '\^([\w-]+)=='", RECIPE)
    assert python | {f'python3-{name}' for name in of_pip} | {'python3-numpy', 'python3-yaml'} == {
        'python3-numba', 'python3-numpy', 'python3-scipy', 'python3-yaml'} <= declared
    pinned = (ROOT / 'requirements' / 'python.txt').read_text(encoding='utf-8')
    assert all(len(re.findall(rf'^{name}==[\d.]+$', pinned, flags=re.MULTILINE)) == 1 for name in of_pip)


def test_it_starts_an_executable_of_the_package_as_a_user_without_rights():
    (user,) = instructions('USER')
    assert all(int(number) > 0 for number in user.split(':'))  # a number: no name is looked up in the image
    (command,) = instructions('CMD')
    path = re.fullmatch(r'\["(\S+)"\]', command)[1]
    (script,) = re.findall(r'script_dir=\$base/(\S+)', (ROOT / 'setup.cfg').read_text(encoding='utf-8'))
    assert path == f'/opt/manta/install/{script}/sim_node'
    assert f"'{Path(path).name} = " in (ROOT / 'setup.py').read_text(encoding='utf-8')
    *_, environment = instructions('ENV')
    assert {name for name, _, _ in (setting.partition('=') for setting in environment.split())} == {
        'NUMBA_CACHE_DIR', 'ROS_LOG_DIR', 'FASTDDS_BUILTIN_TRANSPORTS'}
    kept, read = (re.search(r'NUMBA_CACHE_DIR=(\S+)', each)[1] for each in instructions('ENV'))
    assert kept == read


def test_it_compiles_the_kernels_of_every_configuration(tmp_path):
    code = re.search(r'python -c "(.*?)" "\$config"', RECIPE, flags=re.DOTALL)[1].replace('\\\n', '')
    configs = sorted((ROOT / 'config').glob('*.yaml'))
    assert len(configs) > 1 and '/share/manta_sim_ros/config/*.yaml' in RECIPE
    for config in configs:
        subprocess.run([sys.executable, '-c', code, config], cwd=tmp_path, check=True, timeout=300)
