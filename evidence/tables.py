"""Write the tables of the documentation from the code: `make tables`.

A table stands between `<!-- table: NAME -->` and `<!-- end -->` in a page of docs/. With --check, nothing is written,
and the exit status is 1 if a table is not the one of the code.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import yaml

from evidence.report import table
from manta_sim_ros.control.joystick import JoystickSettings
from manta_sim_ros.control.manual import ManualSettings
from manta_sim_ros.control.mission import MISSIONS
from manta_sim_ros.control.mpc_settings import MpcSettings
from manta_sim_ros.control.settings import FollowerSettings
from manta_sim_ros.control.teleoperation import KEYS
from manta_sim_ros.dynamics import ParameterGroup, Quantity
from manta_sim_ros.nodes.interface import SERVICES, TOPICS
from manta_sim_ros.nodes.settings import Settings

ROOT = Path(__file__).parents[1]
KERNELS = ROOT / 'manta_sim_ros' / 'dynamics' / '_kernels'
LAST_EQUATION = 38
MARKED = re.compile(r'(<!-- table: (.+?) -->\n).*?(<!-- end -->)', re.DOTALL)


def topics(direction: str) -> str:
    """Return the topics that the simulator subscribes to (`in`) or publishes (`out`)."""
    return table(('topic', 'type', 'meaning'), (
        (f'`{name}`', f'`{topic.type}`', topic.meaning)
        for name, topic in TOPICS.items() if topic.direction == direction))


def services() -> str:
    """Return the services."""
    return table(('service', 'type', 'meaning'), (
        (f'`{name}`', f'`{service.type}`', service.meaning) for name, service in SERVICES.items()))


def parameters() -> str:
    """Return the parameters of the simulator."""
    settings = Settings()
    return table(('parameter', 'default', 'unit', 'bounds', 'live', 'meaning', 'source'), (
        (f'`{name}`', f'`{_shown(settings.value(name))}`', about.unit, _bounds(about),
         'yes' if about.live else 'no', about.description, about.source)
        for name, about in Settings.quantities().items()))


def group_parameters(*groups: ParameterGroup) -> str:
    """Return the parameters of a node that are those of some groups."""
    return table(('parameter', 'default', 'unit', 'bounds', 'meaning', 'source'), (
        (f'`{group.prefix}{name}`', f'`{_shown(_rounded(getattr(group, name)))}`', about.unit, _bounds(about),
         about.description, about.source)
        for group in groups for name, about in group.quantities().items()))


def teleop_keys() -> str:
    """Return what the keys of teleop do."""
    rows = [(' or '.join(f'`{name}`' for name in key.keys), key.word, key.meaning) for key in KEYS.values()]
    return table(('key', 'action', 'meaning'), [*rows, ('`q` or `ctrl+c`', 'quit', 'stops the fins and leaves')])


def teleop_screen() -> str:
    """Return the screen of teleop."""
    from evidence.teleop_screen import picture  # needs Textual

    return f'```text\n{picture()}\n```'


def missions() -> str:
    """Return the values of each kind of mission."""
    return table(('kind', 'value', 'default', 'unit', 'bounds', 'meaning'), (
        (f'`{kind}`', f'`{name}`', f'`{_shown(getattr(mission(), name))}`', about.unit, _bounds(about),
         about.description)
        for kind, mission in MISSIONS.items() for name, about in mission.quantities().items()))


def learning_options() -> str:
    """Return the options of the environment Swim."""
    from manta_sim_ros.learning import SwimSettings  # needs Gymnasium, unlike the other tables

    settings = SwimSettings()
    return table(('option', 'default', 'unit', 'bounds', 'meaning'), (
        (f'`{name}`', f'`{_shown(getattr(settings, name))}`', about.unit, _bounds(about), about.description)
        for name, about in SwimSettings.quantities().items()))


def learning_action(kind: str) -> str:
    """Return what the numbers of an action mean."""
    from manta_sim_ros.learning import action_numbers

    return _numbers('at -1', 'at 1', action_numbers(kind))


def learning_observation() -> str:
    """Return what the numbers of an observation mean."""
    from manta_sim_ros.learning import OBSERVATION

    return _numbers('lower bound', 'upper bound', OBSERVATION)


def _numbers(low: str, high: str, numbers: Sequence[Any]) -> str:
    return table(('index', 'number', 'unit', low, high, 'meaning'), (
        (str(index), f'`{number.name}`', number.unit, f'{number.low:.4g}', f'{number.high:.4g}', number.meaning)
        for index, number in enumerate(numbers)))


def _rounded(value: Any) -> Any:
    return float(f'{value:.4g}') if isinstance(value, float) else value


def _shown(value: object) -> str:
    if isinstance(value, float) and abs(value) >= 1e6:
        return f'{value:g}'
    text = yaml.safe_dump(list(value) if isinstance(value, tuple) else value, default_flow_style=True)
    return str(text).removesuffix('\n').removesuffix('\n...')


def _bounds(about: Quantity) -> str:
    if about.kind in (int, float, tuple):
        return f'{about.low:g} to {about.high:g}'
    return ' or '.join(about.choices)


Arguments = dict[str, tuple[str, str]]
"""Default and meaning of each argument of a launch file."""


def launch_arguments(name: str) -> Arguments:
    """Return the arguments that a launch file declares, from its source: it needs no launch package."""
    tree = ast.parse((ROOT / 'launch' / name).read_text(encoding='utf-8'))
    declared = {}
    for call in _calls(tree, 'DeclareLaunchArgument'):
        options = {option.arg: option.value for option in call.keywords}
        parts = [str(part.value) for part in ast.walk(options['default_value']) if isinstance(part, ast.Constant)]
        default = '/'.join(part for part in parts if part != 'manta_sim_ros')  # a path in the share of the package
        declared[_text(call.args[0])] = default or "''", _text(options['description'])
    return declared


def two_mantas() -> Arguments:
    """Return the arguments of two_mantas.launch.py, with those that it leaves to the launch file of each robot."""
    tree = ast.parse((ROOT / 'launch' / 'two_mantas.launch.py').read_text(encoding='utf-8'))
    of_one = launch_arguments('sim.launch.py')
    function = next(node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name == 'robot')
    always = {_text(key) for node in ast.walk(function) if isinstance(node, ast.Dict) for key in node.keys
              if isinstance(key, ast.Constant)}
    free: dict[str, list[str]] = {}
    declared = launch_arguments('two_mantas.launch.py')
    for call in _calls(tree, 'robot'):
        set_here = always | set(declared) | {str(option.arg) for option in call.keywords}
        for argument in of_one:
            if argument not in set_here:
                free.setdefault(argument, []).append(_text(call.args[0]))
    return declared | {
        argument: (of_one[argument][0], f'{of_one[argument][1]} (of {" and ".join(robots)})')
        for argument, robots in free.items()}


def _calls(tree: ast.AST, name: str) -> list[ast.Call]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == name]


def _text(node: ast.expr | None) -> str:
    return str(ast.literal_eval(node)) if node is not None else ''


def arguments_table(arguments: Arguments) -> str:
    """Return the arguments of a launch file."""
    return table(('argument', 'default', 'meaning'), (
        (f'`{name}`', f'`{default}`', meaning) for name, (default, meaning) in arguments.items()))


def equations() -> str:
    """Return where each equation of the paper is computed, from the docstrings of the kernels."""
    places: dict[int, list[str]] = {number: [] for number in range(1, LAST_EQUATION + 1)}
    for path in sorted(KERNELS.glob('*.py')):
        for node in ast.parse(path.read_text(encoding='utf-8')).body:
            if isinstance(node, ast.FunctionDef):
                for number in equation_numbers(ast.get_docstring(node) or ''):
                    anchor = f'kernels.md#manta_sim_ros.dynamics._kernels.{path.stem}.{node.name}'
                    places[number].append(f'[`{path.stem}.{node.name}`]({anchor})')
    return table(('equation', 'function in `manta_sim_ros/dynamics/_kernels`'), (
        (f'({number})', ', '.join(found)) for number, found in places.items() if found))


def equation_numbers(text: str) -> set[int]:
    """Return the numbers of the equations in a text, such as (12), or those from (18) to (26)."""
    numbers = {int(number) for number in re.findall(r'\((\d+)\)', text)}
    for first, last in re.findall(r'\((\d+)\)(?: to |-)\((\d+)\)', text):
        numbers |= set(range(int(first), int(last) + 1))
    return {number for number in numbers if number <= LAST_EQUATION}


TABLES: dict[str, Callable[[], str]] = {
    'topics in': lambda: topics('in'),
    'topics out': lambda: topics('out'),
    'services': services,
    'parameters': parameters,
    'sim.launch.py': lambda: arguments_table(launch_arguments('sim.launch.py')),
    'swim.launch.py': lambda: arguments_table(launch_arguments('swim.launch.py')),
    'two_mantas.launch.py': lambda: arguments_table(two_mantas()),
    'path follower': lambda: group_parameters(FollowerSettings()),
    'model-predictive follower': lambda: group_parameters(MpcSettings()),
    'teleop': lambda: group_parameters(ManualSettings(), JoystickSettings()),
    'teleop keys': teleop_keys,
    'teleop screen': teleop_screen,
    'missions': missions,
    'learning options': learning_options,
    'action gait': lambda: learning_action('gait'),
    'action rods': lambda: learning_action('rods'),
    'observation': learning_observation,
    'equations': equations,
}


def with_tables(page: str) -> str:
    """Return a page with its tables as the code says; raise a KeyError for an unknown table."""
    return MARKED.sub(lambda found: f'{found[1]}\n{TABLES[found[2]]()}\n\n{found[3]}', page)


def pages() -> Iterable[Path]:
    """Return the pages of the documentation."""
    return sorted((ROOT / 'docs').glob('*.md'))


def main(arguments: Sequence[str]) -> int:
    """Write or check all tables; return the exit status."""
    stale = []
    for path in pages():
        page = path.read_text(encoding='utf-8')
        if (new := with_tables(page)) != page:
            stale.append(path.name)
            if '--check' not in arguments:
                path.write_text(new, encoding='utf-8')
    if '--check' in arguments and stale:
        print(f'tables are not those of the code in {", ".join(stale)}: run make tables', file=sys.stderr)
        return 1
    print(f'tables: {", ".join(stale) if stale else "nothing changed"}')
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
