"""What a robot does in the gaits of the paper: thrust, cruise, Strouhal number, power, and turns."""

from __future__ import annotations

import dataclasses
import math
import warnings
from pathlib import Path

from manta_sim_ros.dynamics import DivergenceError, Parameters, StabilityWarning, largest_stable_step
from manta_sim_ros.figures.figure_8 import PHASE_OF_AMPLITUDES, mean_thrust
from manta_sim_ros.figures.gaits import STRAIGHT, TURNS, gait, robot
from manta_sim_ros.figures.jobs import Done
from manta_sim_ros.figures.record import Record, record
from manta_sim_ros.figures.turning import PERIODS, Turn
from manta_sim_ros.nodes.transport import cost_of_transport
from manta_sim_ros.studies.swim import strouhal, tip_excursion

CONFIG = Path(__file__).parents[2] / 'config'
CONFIGURATIONS = ('manta.yaml', 'freshwater.yaml')
"""Files in config/: the paper's robot, and the robot in fresh water."""
FREQUENCY = STRAIGHT.frequency
"""Frequency of all straight gaits, and the greatest of the prototype [Hz]."""
AMPLITUDES = (20.0, 30.0, 40.0, 50.0)
"""Amplitudes of straight gaits [degrees]. The thrust is greatest with the last one."""
CRUISE = 24
"""Number of periods of a straight swim; the last PERIODS_OF_MEAN of them are its cruise."""
PERIODS_OF_MEAN = 2
MARGIN = 0.8
"""Largest time step over `largest_stable_step`, which is an estimate."""


@dataclasses.dataclass(frozen=True)
class Result:
    """A result of a robot."""

    name: str
    unit: str
    digits: int
    """Decimals with which its value is printed and compared."""

    def rounded(self, value: float) -> float:
        """Return the magnitude of a value as it is printed."""
        return round(abs(value), self.digits)


RESULTS = {
    'thrust': Result('greatest mean thrust', 'N', 1),
    'speed': Result('cruise speed', 'm/s', 3),
    'fastest': Result('greatest speed', 'm/s', 3),
    'strouhal': Result('Strouhal number', '', 2),
    'power': Result('mean rod power', 'W', 1),
    'cost': Result('cost of transport', '', 3),
    'rate 1': Result('yaw rate, set 1', '°/s', 1),
    'radius 1': Result('turning radius, set 1', 'm', 2),
    'rate 2': Result('yaw rate, set 2', '°/s', 1),
    'radius 2': Result('turning radius, set 2', 'm', 2),
}
VARIED = tuple(name for name in RESULTS if name != 'fastest')
"""The results whose dependence on parameters is measured."""


@dataclasses.dataclass(frozen=True)
class Cruise:
    """The end of a straight swim."""

    speed: float
    """Mean forward speed [m/s]."""
    power: float
    """Mean power of the motors into the fins [W]."""
    excursion: float
    """Distance between the highest and the lowest position of a fin tip in the world, mean over all chains [m]."""

    @property
    def strouhal(self) -> float:
        """Frequency times excursion over speed."""
        return strouhal(FREQUENCY, self.excursion, self.speed)


def configuration(name: str) -> Parameters:
    """Return the parameters of a file of CONFIGURATIONS; commands take effect at once, as in the paper."""
    return robot(Parameters.from_yaml(CONFIG / name))


def cruise(parameters: Parameters, amplitude: float) -> Cruise:
    """Swim straight with an amplitude [degrees] from rest, and return the end of the swim."""
    both = gait(amplitude, FREQUENCY)
    return at_end(record(parameters, both, both, CRUISE))


def at_end(states: Record) -> Cruise:
    """Return the means of the last periods of a swim."""
    last = slice(-PERIODS_OF_MEAN * states.samples, None)
    states = dataclasses.replace(states, **{
        field.name: getattr(states, field.name)[last]
        for field in dataclasses.fields(states) if field.type == 'FloatArray'})
    return Cruise(
        float(states.twist[:, 0].mean()), float(states.rod_power.mean()), tip_excursion(
            states.parameters, states.position, states.orientation, states.rod_angles, states.joint_angles))


def measure(parameters: Parameters) -> dict[str, float]:
    """Return all VARIED results of a robot; those that diverge are NaN."""
    parameters = stable(parameters)
    amplitude, results = math.degrees(STRAIGHT.amplitude), dict.fromkeys(VARIED, math.nan)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('error', StabilityWarning)
            results['thrust'] = mean_thrust(parameters, AMPLITUDES[-1], FREQUENCY, PHASE_OF_AMPLITUDES)[1]
            swim = cruise(parameters, amplitude)
            weight = parameters.body.mass * parameters.body.gravity
            results |= {'speed': swim.speed, 'strouhal': swim.strouhal, 'power': swim.power,
                        'cost': cost_of_transport(swim.power, swim.speed, weight)}
            for number, (name, gaits) in enumerate(TURNS.items(), start=1):
                turn = Turn(name, record(parameters, *gaits, PERIODS))
                results |= {f'rate {number}': turn.turning_rate, f'radius {number}': turn.turning_radius}
    except DivergenceError:
        pass
    return results


def stable(parameters: Parameters) -> Parameters:
    """Return parameters whose time step is stable in all gaits: their own, or a smaller one."""
    largest = min(largest_stable_step(parameters, *gaits) for gaits in ((STRAIGHT, STRAIGHT), *TURNS.values()))
    return parameters.replace(solver={'time_step': min(parameters.solver.time_step, MARGIN * largest)})


@dataclasses.dataclass(frozen=True)
class Measured:
    """What a configuration does."""

    swims: tuple[Cruise, ...]
    """The cruise with each of AMPLITUDES."""
    results: dict[str, float]
    """The value of each of RESULTS."""


def measured(name: str, done: Done) -> Measured:
    """Measure a configuration, as a job."""
    parameters = configuration(name)
    swims = tuple(cruise(parameters, amplitude) for amplitude in AMPLITUDES)
    results = measure(parameters) | {'fastest': max(swim.speed for swim in swims)}
    done()
    return Measured(swims, {key: results[key] for key in RESULTS})
