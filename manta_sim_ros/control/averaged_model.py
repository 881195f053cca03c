"""A model of the motion averaged over a flapping period: polynomials for the rates of the twist."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from manta_sim_ros.dynamics import cut, shown

TWIST = ('u', 'v', 'w', 'p', 'q', 'r')
"""Velocity through the water [m/s] and angular velocity [rad/s], body frame."""

GAIT = ('amplitude', 'steering', 'bias')
"""Amplitude of both fins, phase added on the right and subtracted on the left, bias added to the front rods and
subtracted from the rear rods [rad]."""

VARIABLES = (*TWIST, 'roll', 'pitch', *GAIT)
"""What the rates of the twist depend on."""

CHANGE_SIDES = frozenset({'v', 'r', 'p', 'roll', 'steering'})
"""Variables that change their sign when left and right are exchanged."""

TURN_OVER = frozenset({'w', 'q', 'p', 'roll', 'pitch', 'bias'})
"""Variables that change their sign when up and down are exchanged: the robot is symmetric on the whole period."""

MODELS = {name: Path(__file__).parent / 'models' / f'{name}.yaml' for name in ('freshwater', 'manta')}
"""Files of the models of config/NAME.yaml."""

LARGEST_FILE = 100_000
"""Largest size of a model file [characters]."""

Term = tuple[str, ...]
"""A product of variables, in their order; the empty one is 1."""


def terms_of(rate: str, degree: int) -> list[Term]:
    """Return the products of at most this many variables on which a rate of the twist may depend by symmetry."""
    return [term for count in range(degree + 1)
            for term in itertools.combinations_with_replacement(VARIABLES, count)
            if all(sum(name in flips for name in term) % 2 == (rate in flips) for flips in (CHANGE_SIDES, TURN_OVER))]


def product(term: Term, values: Mapping[str, Any]) -> Any:
    """Return the product of the values of the variables of a term; they may be arrays or symbols."""
    return math.prod((values[name] for name in term[1:]), start=values[term[0]]) if term else 1.0


@dataclasses.dataclass(frozen=True)
class AveragedModel:
    """How the mean twist over a flapping period changes, for gaits about one frequency and phase.

    Raises
    ------
    ValueError
        A rate, a variable or a coefficient is wrong; names it.

    """

    frequency: float
    """Of the flapping [Hz]."""
    phase: float
    """Mean phase of both fins [rad]."""
    gait_lag: float
    """Time by which the gait in force is behind the command [s]."""
    rates: dict[str, dict[Term, float]]
    """Coefficients of the terms of each rate of TWIST [SI units, rad]."""

    def __post_init__(self) -> None:
        """Check the values."""
        for name, low, high in (('frequency', 0.1, 2.0), ('phase', 0.1, 1.5), ('gait_lag', 0.0, 10.0)):
            value = getattr(self, name)
            if not (isinstance(value, float) and low <= value <= high):
                raise ValueError(f'{name} is {shown(value)}, but must be a number from {low:g} to {high:g}')
        if tuple(self.rates) != TWIST:
            raise ValueError(f'the rates are {shown(list(self.rates))}, but must be {list(TWIST)}')
        for rate, terms in self.rates.items():
            for term, coefficient in terms.items():
                for name in term:
                    if name not in VARIABLES:
                        raise ValueError(f'the rate of {rate} depends on {shown(name)}, but must on {VARIABLES}')
                if not (isinstance(coefficient, float) and math.isfinite(coefficient)):
                    raise ValueError(
                        f'the coefficient of {"*".join(term)} in the rate of {rate} is {shown(coefficient)}, but must '
                        'be a finite number')

    @property
    def period(self) -> float:
        """Flapping period [s]."""
        return 1.0 / self.frequency

    def twist_rates(self, values: Mapping[str, Any]) -> list[Any]:
        """Return the rates of TWIST for values of VARIABLES, which may be arrays or symbols."""
        return [sum(coefficient * product(term, values) for term, coefficient in self.rates[rate].items())
                for rate in TWIST]

    def as_yaml(self) -> str:
        """Return the content of a model file."""
        lines = [f'frequency: {self.frequency:.6g}', f'phase: {self.phase:.6g}', f'gait_lag: {self.gait_lag:.6g}',
                 'rates:']
        for rate, terms in self.rates.items():
            lines.append(f'  {rate}:')
            lines += [f'    {"*".join(term) or 1}: {coefficient:.5g}' for term, coefficient in terms.items()]
        return '\n'.join([*lines, ''])


def read_model(file: str | Path) -> AveragedModel:
    """Return the model of a file as `AveragedModel.as_yaml` gives it.

    Raises
    ------
    ValueError
        The file cannot be read, or is no model: names it and what is wrong.

    """
    try:
        with Path(file).open(encoding='utf-8') as opened:
            text = opened.read(LARGEST_FILE + 1)
        if len(text) > LARGEST_FILE:
            raise ValueError(f'has more than {LARGEST_FILE} characters')
        return _model_of(yaml.safe_load(text))
    except (OSError, RecursionError, ValueError, yaml.YAMLError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise ValueError(f'model {shown(str(file))}: {cut(" ".join(str(reason).split()), 200)}') from error


def _model_of(content: object) -> AveragedModel:
    names = [field.name for field in dataclasses.fields(AveragedModel)]
    if not (isinstance(content, dict) and list(content) == names):
        raise ValueError(f'must have {", ".join(names)} in this order, and nothing else')
    rates = content.pop('rates')
    if not (isinstance(rates, dict) and all(isinstance(terms, dict) for terms in rates.values())):
        raise ValueError('rates must have a group of coefficients for each rate')
    return AveragedModel(**_numbers(content), rates={
        rate: _numbers({_term(text): value for text, value in terms.items()}) for rate, terms in rates.items()})


def _term(text: object) -> Term:
    return () if text == 1 else tuple(str(text).split('*'))


def _numbers(values: Mapping[Any, Any]) -> dict[Any, Any]:
    """Return values with whole numbers as floats; what is no number is kept, to be refused."""
    return {name: float(value) if isinstance(value, int) and not isinstance(value, bool) else value
            for name, value in values.items()}


def variables(values: Sequence[Any]) -> dict[str, Any]:
    """Return values of VARIABLES by name."""
    return dict(zip(VARIABLES, values, strict=True))
