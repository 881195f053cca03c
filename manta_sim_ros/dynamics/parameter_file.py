"""Parameter files of ROS 2, read as ROS 2 itself reads them (rcl): which values apply to a node."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from manta_sim_ros.dynamics.quantity import cut, shown

LARGEST_FILE = 1_000_000
"""Largest size of a parameter file [characters]: far more than one with a comment on every parameter has."""

LONGEST_REASON = 400
"""Largest number of characters of what is wrong with a file: PyYAML shows parts of it."""

BELOW = 'ros__parameters'
"""The key that is between the name of a node and its parameters."""

TRUE = {'Y', 'y', 'yes', 'Yes', 'YES', 'true', 'True', 'TRUE', 'on', 'On', 'ON'}
FALSE = {'N', 'n', 'no', 'No', 'NO', 'false', 'False', 'FALSE', 'off', 'Off', 'OFF'}
WHOLE = re.compile(r'[-+]?(?:0[xX][0-9a-fA-F]{1,16}|0[0-7]{0,18}|[1-9][0-9]{0,18})')
DECIMAL = re.compile(
    r'[-+]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?|\.?(?:inf|nan)|infinity)', re.IGNORECASE)
"""What rcl takes for a number. `1e8` is one, unlike in PyYAML, but `1_000` and `1:30` are texts."""


class Section(NamedTuple):
    """The parameters below one name of a node."""

    node: str
    """Full name of the node, or a pattern: `*` stands for one name and `**` for any number of them."""
    values: dict[str, Any]
    """The parameters by their full names, such as `fin.chains`."""

    def applies_to(self, node: str) -> bool:
        """Whether the parameters are for the node of this full name."""
        pattern = re.escape(self.node).replace(r'/\*\*', r'(?:/\w+)*').replace(r'/\*', r'/\w+')
        return re.fullmatch(pattern, node, re.ASCII) is not None


def read_sections(path: str | Path) -> list[Section]:
    """Return the sections of a parameter file, in its order.

    Raises
    ------
    ValueError
        The file is not such a file, or a name stands twice. Begins with the path, and names the line.
    OSError
        The file cannot be read.

    """
    try:
        with Path(path).open(encoding='utf-8') as file:
            text = file.read(LARGEST_FILE + 1)
        if len(text) > LARGEST_FILE:
            raise ValueError(f'has more than {LARGEST_FILE} characters, the largest size of a parameter file')
        content = yaml.compose(text, Loader=_Loader)
        if not isinstance(content, yaml.MappingNode):
            raise ValueError(f"has no '/**:' with '{BELOW}:' below it")
        return list(_sections(content))
    except RecursionError as error:
        raise ValueError(f'{path}: is nested too deeply for a parameter file') from error
    except (ValueError, yaml.YAMLError) as error:
        raise ValueError(f'{path}: {cut(" ".join(str(error).split()), LONGEST_REASON)}') from error


def values_for(node: str, sections: Sequence[Section]) -> dict[str, Any]:
    """Return the parameters of the node of this full name: of all sections that apply, the later one wins."""
    return {
        name: value for section in sections if section.applies_to(node) for name, value in section.values.items()}


class _Loader(yaml.BaseLoader):
    """Refuses aliases, as rcl does, since few of them make an endless file."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise ValueError(f'aliases are not allowed, line {_line(self.peek_event())}')  # type: ignore[no-untyped-call]
        return super().compose_node(parent, index)

    def resolve(self, kind: Any, value: Any, implicit: Any) -> Any:
        """Give no tag to what has none."""
        return ''


def _sections(group: yaml.MappingNode, node: str = '') -> Iterator[Section]:
    for key, value in _items(group):
        name = key.value
        if not isinstance(value, yaml.MappingNode):
            if not node:
                raise ValueError(f"has no '/**:' with '{BELOW}:' below it, but {shown(name)}, line {_line(key)}")
            parts = 'with parameters below it' if name == BELOW else f'above {shown(name)}'
            raise ValueError(f"has no '{BELOW}:' {parts}, line {_line(key)}")
        if name == BELOW:
            yield Section(node, _values(value))
        else:
            yield from _sections(value, f'{node}/{name.removeprefix("/")}')


def _values(group: yaml.MappingNode) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name, key, value in _named(group):
        if name in values:
            raise ValueError(f'{shown(name)} stands twice, line {_line(key)}')
        values[name] = _value(value)
    return values


def _named(group: yaml.MappingNode, prefix: str = '') -> Iterator[tuple[str, yaml.ScalarNode, yaml.Node]]:
    """Yield the full name, the key and the value of each parameter."""
    for key, value in _items(group):
        if isinstance(value, yaml.MappingNode):
            yield from _named(value, f'{prefix}{key.value}.')
        else:
            yield f'{prefix}{key.value}', key, value


def _items(group: yaml.MappingNode) -> Iterator[tuple[yaml.ScalarNode, yaml.Node]]:
    seen = set()
    for key, value in group.value:
        if not isinstance(key, yaml.ScalarNode):
            raise ValueError(f'a name must be a text, not a list or a group, line {_line(key)}')
        if key.value in seen:
            raise ValueError(f'{shown(key.value)} stands twice in the same group, line {_line(key)}')
        seen.add(key.value)
        yield key, value


def _value(node: yaml.Node) -> Any:
    if isinstance(node, yaml.SequenceNode):
        return [_value(part) for part in node.value]
    if not isinstance(node, yaml.ScalarNode):
        raise ValueError(f'a list must not have groups in it, line {_line(node)}')
    text = node.value
    if node.style in ("'", '"') or node.tag == 'tag:yaml.org,2002:str':
        return text
    if not text:
        return None
    if text in TRUE or text in FALSE:
        return text in TRUE
    if WHOLE.fullmatch(text):
        number = int(text, 16 if 'x' in text.lower() else 8 if text.lstrip('-+').startswith('0') else 10)
        return number if -2**63 <= number < 2**63 else float(number)
    return float(text.lower().replace('.inf', 'inf').replace('.nan', 'nan')) if DECIMAL.fullmatch(text) else text


def _line(part: Any) -> int:
    return int(part.start_mark.line) + 1
