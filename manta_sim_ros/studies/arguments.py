"""What the commands of the studies have in common: errors in one line, parameter files, and where they write."""

from __future__ import annotations

import argparse
import difflib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from manta_sim_ros.dynamics import read_sections, shown_name, shown_names, values_for
from manta_sim_ros.nodes.settings import Settings

NODE = '/manta_sim'
"""The node whose parameters are read."""

OF_THE_NODE_ALONE = ('use_sim_time', 'start_type_description_service', 'qos_overrides')
"""Parameters, and the group, that only a node of ROS 2 has."""


LONGEST_DURATION = 1e6
"""Longest simulated time of a swim [s]: eleven days."""


class Parser(argparse.ArgumentParser):
    """Ends the process with status 2 and one line when an argument is wrong. What begins as -10,20 is no option."""

    def __init__(self, **about: Any) -> None:
        super().__init__(**about)
        self._negative_number_matcher = re.compile(r'-\.?\d')

    def error(self, message: str) -> NoReturn:
        """Print the line and end the process."""
        self.exit(2, f'{self.prog}: {" ".join(message.split())}\n')


def check_output(option: str, path: Path, suffix: str = '', inputs: Sequence[Path | None] = ()) -> None:
    """Raise a ValueError if a file with this suffix cannot be written there, or if that would replace an input."""
    if not path.name or path.is_dir() or not path.parent.is_dir() or not path.name.endswith(suffix):
        kind = f'a {suffix} file' if suffix else 'a file'
        raise ValueError(f'{option} is {path}, but must be {kind} in a directory that exists')
    if path.exists() and any(given is not None and given.exists() and path.samefile(given) for given in inputs):
        raise ValueError(f'{option} is {path}, but that is an input: it would be replaced')


def read_settings(path: str | Path) -> Settings:
    """Return the parameters that a ROS 2 parameter file has for the node `/manta_sim`.

    Raises
    ------
    ValueError
        The file is not such a file or has nothing for this node, a name is unknown, or a value is invalid. Begins with
        the path.
    OSError
        The file cannot be read.

    """
    sections = read_sections(path)
    if not any(section.applies_to(NODE) for section in sections):
        raise ValueError(
            f'{path}: is for {shown_names(section.node for section in sections) or "no node"}, but must be for {NODE}')
    known = Settings.quantities()
    values = {name: value for name, value in values_for(NODE, sections).items()
              if name.partition('.')[0] not in OF_THE_NODE_ALONE}
    for name in values:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            raise ValueError(f'{path}: {shown_name(name)} is no parameter{f"; is {near[0]} meant?" if near else ""}')
    try:
        return Settings().replace(values.items())
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from error
