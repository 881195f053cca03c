"""Study files: which values of gait and parameters are varied, and the cases that follow."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import math
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.stats import qmc

from manta_sim_ros import __version__
from manta_sim_ros.dynamics import SIDES, FloatArray, Parameters, cut, shown, shown_name
from manta_sim_ros.studies.arguments import LONGEST_DURATION
from manta_sim_ros.studies.gaits import NAMES, UNITS, Gaits, gait_of

KEYS = ('config', 'duration', 'gait', 'parameters', 'sampling')
GAIT_NAMES = (*NAMES, *(f'{side}_{name}' for side in SIDES for name in NAMES))
"""Names of gait values: of both fins, or of one, which goes before that of both."""

GRID, LATIN_HYPERCUBE, SOBOL = 'grid', 'latin_hypercube', 'sobol'
METHODS = {LATIN_HYPERCUBE: qmc.LatinHypercube, SOBOL: qmc.Sobol}
QUANTITIES = Parameters.quantities()

WHOLE_STEPS_TOLERANCE = 1e-6
"""Largest difference of a duration from a whole number of time steps, in steps."""

MOST_CASES = 1_000_000
LARGEST_FILE = 1_000_000
"""Largest size of a study file [characters]."""


@dataclasses.dataclass(frozen=True)
class Study:
    """A study: what all cases have in common, and the values of each case."""

    parameters: Parameters
    """Parameters of all cases, before those that are varied."""
    duration: float
    """Simulated time of a case, from rest [s]."""
    gait: dict[str, Any]
    """Values of GAIT_NAMES that are the same in all cases [degrees, Hz]."""
    names: tuple[str, ...]
    """Names of what is varied: of GAIT_NAMES, or of parameters, such as `fin.span` or `body.inertia[0]`."""
    cases: dict[int, tuple[Any, ...]]
    """The values of each case by its number, in the order of `names`."""

    @property
    def digest(self) -> str:
        """Digest of all that the results depend on, the version of the package included."""
        return hashlib.sha256(repr((__version__, dataclasses.astuple(self))).encode()).hexdigest()

    def part(self, cases: Sequence[int]) -> Study:
        """Return a study of some of its cases."""
        return dataclasses.replace(self, cases={case: self.cases[case] for case in cases})

    def inputs(self, case: int) -> dict[str, Any]:
        """Return the varied values of a case by their names."""
        return dict(zip(self.names, self.cases[case], strict=True))

    def parameters_of(self, case: int) -> Parameters:
        """Return the parameters of a case, or raise a ValueError that names what is wrong."""
        return with_parameters(
            self.parameters, {name: value for name, value in self.inputs(case).items() if name not in GAIT_NAMES})

    def gaits_of(self, case: int) -> Gaits:
        """Return the gaits of a case, or raise a ValueError that names what is wrong."""
        varied = {name: value for name, value in self.inputs(case).items() if name in GAIT_NAMES}
        return _gaits({**self.gait, **varied})


def read_study(path: Path) -> Study:
    """Read a study file.

    Raises
    ------
    ValueError
        The file is no study, or a key or value is wrong: begins with the path, and names key, value and bound.
    OSError
        The file, or the parameter file that it names, cannot be read.

    """
    try:
        with path.open(encoding='utf-8') as file:
            text = file.read(LARGEST_FILE + 1)
        if len(text) > LARGEST_FILE:
            raise ValueError(f'has more than {LARGEST_FILE} characters, the largest size of a study file')
        return _study(_Loader(text).get_single_data(), path.parent)
    except RecursionError as error:
        raise ValueError(f'{path}: is nested too deeply for a study file') from error
    except (ValueError, yaml.YAMLError) as error:
        raise ValueError(f'{path}: {cut(" ".join(str(error).split()), 400)}') from error


def unit_of(name: str) -> str:
    """Return the unit of a value of GAIT_NAMES or of a parameter."""
    if name in GAIT_NAMES:
        return UNITS[name.removeprefix('left_').removeprefix('right_')]
    return QUANTITIES[name.partition('[')[0]].unit


def check_duration(duration: float, parameters: Parameters) -> None:
    """Raise a ValueError if a duration [s] is not above 0, too long, or no whole number of time steps."""
    step = parameters.solver.time_step
    if duration > LONGEST_DURATION:
        raise ValueError(f'duration is {duration:g} s, but must be at most {LONGEST_DURATION:g} s')
    if not duration > 0.0 or abs(duration / step - round(duration / step)) > WHOLE_STEPS_TOLERANCE:
        raise ValueError(
            f'duration is {duration:g} s, but must be above 0 and a whole number of steps of solver.time_step, '
            f'{step:g} s')


class _Loader(yaml.SafeLoader):
    """Refuses a key that stands twice in a group."""

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        keys = [key.value for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise ValueError(f'{shown_name(key)} stands twice, line {node.start_mark.line + 1}')
        return super().construct_mapping(node, deep)


def _study(content: Any, folder: Path) -> Study:
    content = _group('the study', content, KEYS, required=('duration', 'gait'))
    config = content.get('config')
    parameters = Parameters() if config is None else Parameters.from_yaml(folder / str(config))
    duration = _number('duration', content['duration'])
    check_duration(duration, parameters)
    gait = _group('gait', content['gait'], GAIT_NAMES)
    others = _group('parameters', content.get('parameters', {}), None)
    for name in others:
        vector = name.partition('[')[0]
        about = QUANTITIES.get(vector)
        if about is None or name not in ([name] if about.size == 1 else [f'{vector}[{i}]' for i in range(about.size)]):
            hint = f': name one value, such as {vector}[0]' if about is not None and about.size > 1 else ''
            raise ValueError(f'parameters: {shown_name(name)} is no parameter{hint}')
    sampling = content.get('sampling', {'method': GRID})
    sampling = _group('sampling', sampling, ('method', 'cases', 'seed'), required=('method',))
    fixed: dict[str, Any] = {}
    ranges: dict[str, list[Any]] = {}
    for name, value in {**gait, **others}.items():
        if isinstance(value, Mapping):
            ranges[name] = _range(name, value, sampling['method'])
        else:
            fixed[name] = _value(name, value)
    fixed_gait = {name: value for name, value in fixed.items() if name in GAIT_NAMES}
    _gaits(fixed_gait)
    parameters = with_parameters(parameters, {name: fixed[name] for name in fixed if name not in GAIT_NAMES})
    for name, values in ranges.items():
        for value in values if 'values' in {**gait, **others}[name] else {values[0], values[-1]}:  # each one alone
            _gaits({name: value}) if name in GAIT_NAMES else with_parameters(parameters, {name: value})
    if not ranges:
        raise ValueError('nothing is varied: give a value of gait or parameters as {from, to, count} or {values}')
    return Study(parameters, duration, fixed_gait, tuple(ranges), dict(enumerate(_cases(ranges, sampling))))


def _range(name: str, given: Mapping[str, Any], method: str) -> list[Any]:
    """Return the values of a grid, or the two ends of what is sampled otherwise."""
    if method == GRID and 'values' in given:
        values = _group(name, given, ('values',))['values']
        if not isinstance(values, Sequence) or isinstance(values, str) or not values:
            raise ValueError(f'{name} has values {shown(values)}, but must have a list of at least one')
        return [_value(name, value) for value in values]
    keys = ('from', 'to', 'count') if method == GRID else ('from', 'to')
    given = _group(name, given, keys, required=keys)
    low, high = (_number(f'{name} {key}', given[key]) for key in ('from', 'to'))
    if not low < high:
        raise ValueError(f'{name} goes from {low:g} to {high:g}, but must go upward')
    count = _whole(f'{name} count', given['count'], 2) if method == GRID else 2
    return list(dict.fromkeys(_value(name, value) for value in np.linspace(low, high, count).tolist()))


def _cases(ranges: dict[str, list[Any]], sampling: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    method = sampling['method']
    if method == GRID:
        if len(sampling) > 1:
            raise ValueError('sampling has cases or seed, which a grid does not take')
        count = math.prod(len(values) for values in ranges.values())
        if count > MOST_CASES:
            raise ValueError(f'the grid has {count} cases, but must have at most {MOST_CASES}')
        return list(itertools.product(*ranges.values()))
    if method not in METHODS:
        raise ValueError(f'sampling method is {shown(method)}, but must be {", ".join((GRID, *METHODS))}')
    count = _whole('sampling cases', sampling.get('cases'), 1, MOST_CASES)
    seed = _whole('sampling seed', sampling.get('seed', 0), 0)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', UserWarning)  # a number of cases that is no power of 2 is allowed
        points: FloatArray = METHODS[method](len(ranges), seed=seed).random(count)
    low, high = np.array([values[0] for values in ranges.values()]), np.array([v[-1] for v in ranges.values()])
    return [
        tuple(_value(name, value) for name, value in zip(ranges, point, strict=True))
        for point in (low + points * (high - low)).tolist()]


def _value(name: str, value: Any) -> Any:
    """Return a value of a gait or a parameter: a number as such, rounded to a whole one where the parameter is one."""
    about = QUANTITIES.get(name)
    kind = float if about is None or about.kind is tuple else about.kind
    if kind is float:
        return _number(name, value)
    if kind is int and isinstance(value, float):
        return round(_number(name, value))
    return value


def with_parameters(parameters: Parameters, values: Mapping[str, Any]) -> Parameters:
    """Return parameters with other values by their names, such as `fin.span` or `body.inertia[0]`.

    Raises
    ------
    ValueError
        A value is invalid; names it and the bound.

    """
    groups: dict[str, dict[str, Any]] = {}
    for full_name, value in values.items():
        name, bracket, index = full_name.partition('[')
        group, _, name = name.partition('.')
        names = groups.setdefault(group, {})
        if bracket:
            vector = list(names.get(name, getattr(getattr(parameters, group), name)))
            vector[int(index[:-1])] = value
            value = vector
        names[name] = value
    return parameters.replace(**groups)


def _gaits(values: Mapping[str, float]) -> Gaits:
    left, right = (
        gait_of(side, {name: values[own] if (own := f'{side}_{name}') in values else values[name]
                       for name in NAMES if name in values or f'{side}_{name}' in values})
        for side in SIDES)
    return left, right


def _group(
    name: str, value: Any, keys: Sequence[str] | None, required: Sequence[str] = (),
) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f'{name} is {shown(value)}, but must be a group of named values')
    for key in value:
        if not isinstance(key, str) or keys is not None and key not in keys:
            raise ValueError(f'{name} has the key {shown(key)}, but takes {", ".join(keys or ("texts",))}')
    for key in required:
        if key not in value:
            raise ValueError(f'{name} has no {key}, but must have {", ".join(required)}')
    return value


def _number(name: str, value: Any) -> float:
    try:
        number = float(value) if not isinstance(value, bool) else math.nan
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f'{name} is {shown(value)}, but must be a finite number')
    return number


def _whole(name: str, value: Any, low: int, high: int = MOST_CASES) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise ValueError(f'{name} is {shown(value)}, but must be a whole number from {low} to {high}')
    return value
