"""What a part measures: facts with a number and what is expected of it; and how long each part is."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from evidence.harness.probe import Probe
from evidence.harness.processes import launcher


@dataclasses.dataclass(frozen=True)
class Fact:
    """Something measured. Without an expectation it is only printed, as it depends on the machine."""

    name: str
    measured: str
    expected: str = ''
    holds: bool = True


def printed(name: str, value: Any) -> Fact:
    """Return a fact that depends on the machine, so that nothing is expected."""
    return Fact(name, shown(value))


def equal(name: str, value: Any, wanted: Any) -> Fact:
    """Return a fact whose value must be exactly this one."""
    return Fact(name, shown(value), shown(wanted), bool(value == wanted))


def at_most(name: str, value: float, bound: float) -> Fact:
    """Return a fact whose value must not exceed a bound."""
    return Fact(name, shown(value), f'at most {shown(bound)}', bool(value <= bound))


def at_least(name: str, value: float, bound: float) -> Fact:
    """Return a fact whose value must reach a bound."""
    return Fact(name, shown(value), f'at least {shown(bound)}', bool(value >= bound))


def shown(value: Any) -> str:
    """Return a value as the page shows it."""
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    if isinstance(value, int):
        return f'{value:,}'
    return f'{value:.3g}' if isinstance(value, float) else str(value)


@dataclasses.dataclass(frozen=True)
class Lengths:
    """How long each part is: numbers of inputs and starts, elapsed seconds, and simulated seconds."""

    inputs: int = 100_000
    load: float = 120.0
    stop: float = 10.0
    starved: float = 20.0
    simulated: float = 86_400.0
    node: float = 3600.0
    starts: int = 200
    swim: float = 10.0
    groups: int = 4
    """Processes of the publishers and of the fast subscribers, each."""
    cold: bool = True
    """Whether kernels are compiled again, which takes about half a minute each."""
    seed: int = 1


SHORT = Lengths(
    inputs=600, load=3.0, stop=1.0, starved=2.0, simulated=30.0, node=5.0, starts=4, swim=1.0, groups=1, cold=False)


@contextlib.contextmanager
def nodes() -> Iterator[tuple[Any, Probe]]:
    """Give `launch(executable, 'ROS arguments', environment={})` and a probe; end everything afterwards."""
    with tempfile.TemporaryDirectory() as folder, contextlib.contextmanager(launcher)(Path(folder)) as launch:
        probe = Probe()
        try:
            yield launch, probe
        finally:
            probe.close()


def resident(pid: int) -> float:
    """Return the resident memory of a process [MiB]."""
    pages = int(Path(f'/proc/{pid}/statm').read_text(encoding='ascii').split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / 2**20
