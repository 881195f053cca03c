"""How much each result depends on each parameter: the exponents of power laws, from values halved and doubled."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from evidence.validation.measurements import CONFIGURATIONS, VARIED, configuration, measure
from manta_sim_ros.dynamics import Parameters
from manta_sim_ros.figures.jobs import Done

FACTORS = (0.5, 2.0)
AXES = ('x', 'y', 'z', 'roll', 'pitch', 'yaw')
"""Names of the components of a vector of six; those of three are the first three of them, or the last three."""


@dataclasses.dataclass(frozen=True)
class Value:
    """A parameter, or one component of it, that is varied."""

    name: str
    """Name of the parameter as in the parameter file."""
    component: int | None = None

    def __str__(self) -> str:
        """Return the name, with the axis of the component."""
        if self.component is None:
            return f'`{self.name}`'
        axis = self.component + 3 * (self.name == 'body.angular_damping')
        return f'`{self.name}`, {AXES[axis]}'

    def of(self, parameters: Parameters) -> float:
        """Return the value in a set of parameters."""
        found: Any = getattr(getattr(parameters, self.name.split('.')[0]), self.name.split('.')[1])
        return float(found if self.component is None else found[self.component])

    def scaled(self, parameters: Parameters, factor: float) -> Parameters:
        """Return parameters with this value times `factor`."""
        group, name = self.name.split('.')
        found: Any = getattr(getattr(parameters, group), name)
        new: Any = type(found)(factor * found) if self.component is None else tuple(
            factor * part if index == self.component else part for index, part in enumerate(found))
        return parameters.replace(**{group: {name: new}})


VALUES = (
    Value('water.density'),
    Value('water.added_mass_coefficient'),
    Value('fin.drag_coefficient'),
    Value('fin.youngs_modulus'),
    Value('fin.shear_modulus'),
    Value('fin.chains'),
    Value('body.drag_coefficient', 0),
    Value('body.drag_coefficient', 1),
    Value('body.drag_coefficient', 2),
    Value('body.added_mass', 2),
    Value('body.angular_damping', 2),
    Value('body.quadratic_damping', 5),
)
"""Values that only an experiment with the robot can tell, and the number of chains, which is a choice.

The dimensions of the robot are not varied; docs/paper.md varies those that the paper does not give.
"""
DENSITY, FIN_DRAG, CHAINS, DRAG, DAMPING = VALUES[0], VALUES[2], VALUES[5], VALUES[6], VALUES[-1]
"""Those that the text of the page names: the drag is that of the body along x, and the damping that of yaw."""
NEARLY = 0.9
"""Share of the largest exponent above which a value decides a result too."""


@dataclasses.dataclass(frozen=True)
class Variant:
    """A configuration with one value changed."""

    configuration: str
    value: Value
    factor: float


def variants() -> list[Variant]:
    """Return all variants; a value that is 0 in a configuration cannot be scaled."""
    return [Variant(name, value, factor) for name in reversed(CONFIGURATIONS) for value in VALUES
            if value.of(configuration(name)) != 0.0 for factor in FACTORS]


def run(variant: Variant, done: Done) -> dict[str, float]:
    """Return the VARIED results of a variant, as a job."""
    parameters = variant.value.scaled(configuration(variant.configuration), variant.factor)
    results = measure(parameters)
    done()
    return results


def exponent(halved: float, doubled: float) -> float:
    """Return p of result ~ value^p; NaN if the result changes its sign or is missing."""
    ratio = doubled / halved
    return math.log(ratio) / math.log(FACTORS[1] / FACTORS[0]) if ratio > 0.0 else math.nan


@dataclasses.dataclass(frozen=True)
class Sensitivity:
    """The results of all variants."""

    results: Mapping[Variant, Mapping[str, float]]

    def exponents(self, name: str) -> dict[Value, dict[str, float]]:
        """Return the exponent of each VARIED result for each value that a configuration has."""
        return {
            value: {key: exponent(*(self.results[Variant(name, value, factor)][key] for factor in FACTORS))
                    for key in VARIED}
            for value in VALUES if Variant(name, value, FACTORS[0]) in self.results}

    def deciding(self, name: str, key: str) -> dict[Value, float]:
        """Return the values with the largest exponents of a result, and these exponents.

        These are all values whose exponent is at least NEARLY of the largest. If the number of chains is among them,
        which is no property of a robot, the largest of the others follows. A change of sign counts as the largest.
        """
        found = {value: of_results[key] for value, of_results in self.exponents(name).items()}
        sizes = {value: math.inf if math.isnan(number) else abs(number) for value, number in found.items()}
        largest = [value for value in found if sizes[value] >= NEARLY * max(sizes.values())]
        if largest == [CHAINS]:
            largest.append(max((value for value in found if value != CHAINS), key=sizes.__getitem__))
        return {value: found[value] for value in largest}
