"""The response of the robot to each input of its gait: mean force and moment, and the motion that follows."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import FinCommand, FloatArray, Parameters, Simulator, State, largest_stable_step
from manta_sim_ros.figures.jobs import Done

CONFIG = Path(__file__).parents[2] / 'config'
CONFIGURATIONS = {name: Parameters.from_yaml(CONFIG / f'{name}.yaml') for name in ('manta', 'freshwater')}
"""The parameters of each file in config/ that is measured."""
AMPLITUDE, FREQUENCY, PHASE = 40.0, 0.6, 40.0
"""The gait of both fins before the change [degrees, Hz, degrees]."""
TRANSIENT, AVERAGED = 5.0, 10.0
"""With the body held: time after the start that is left out, and time of the mean [s], three and six periods."""
CRUISE, SWIM = 20.0, 10.0
"""Free: time of swimming before the change, and after it [s]."""
TURN = 5.0
"""Time after the change over which the turn is measured [s]."""
SETTLED = 10.0 / 3.0
"""Time at the end over which speed, pitch and roll are averaged [s], two periods."""
SAMPLE = 0.01
"""Time between two samples [s]."""


@dataclasses.dataclass(frozen=True)
class Change:
    """A change of the gait: what is added to the values of the left and of the right fin [degrees, Hz]."""

    name: str
    left: dict[str, float] = dataclasses.field(default_factory=dict)
    right: dict[str, float] = dataclasses.field(default_factory=dict)

    @property
    def commands(self) -> tuple[FinCommand, FinCommand]:
        """The commands of the left and of the right fin."""
        return gait(**self.left), gait(**self.right)


def _both(name: str, **values: float) -> Change:
    return Change(name, values, values)


REVERSED = _both('phase of both fins - 80°, so that it is - 40°', phase=-80.0)
RIGHT_AMPLITUDE = Change('amplitude of the right fin - 20°', {}, {'amplitude': -20.0})
RIGHT_PHASE = Change('phase of the right fin - 20°', {}, {'phase': -20.0})
RIGHT_FREQUENCY = Change('frequency of the right fin - 0.2 Hz', {}, {'frequency': -0.2})
FRONT_BIAS = _both('front bias of both fins + 5°', front_bias=5.0)
OPPOSITE_BIASES = Change(
    'front bias of the left fin + 5°, of the right fin - 5°', {'front_bias': 5.0}, {'front_bias': -5.0})
CHANGES = (
    Change('no change'),
    _both('amplitude of both fins - 10°', amplitude=-10.0),
    _both('frequency of both fins - 0.2 Hz', frequency=-0.2),
    _both('phase of both fins - 20°', phase=-20.0),
    REVERSED,
    RIGHT_AMPLITUDE,
    RIGHT_PHASE,
    RIGHT_FREQUENCY,
    FRONT_BIAS,
    _both('rear bias of both fins + 5°', rear_bias=5.0),
    _both('both biases of both fins + 5°', front_bias=5.0, rear_bias=5.0),
    Change('front bias of the left fin + 5°', {'front_bias': 5.0}, {}),
    OPPOSITE_BIASES,
)
TURNS = (RIGHT_AMPLITUDE, RIGHT_PHASE, RIGHT_FREQUENCY)
CHAINS = (8, 12, 30)
"""Numbers of chains with which the yaw rates of `TURNS` are compared."""
GRID = tuple((amplitude, frequency) for frequency in (0.3, 0.45, 0.6) for amplitude in (20.0, 30.0, 40.0))
"""Amplitudes [degrees] and frequencies [Hz] of the straight gaits whose speeds are measured."""


@dataclasses.dataclass(frozen=True)
class Response:
    """What a change does."""

    change: Change
    wrench: FloatArray
    """(6,) mean force [N] and moment [N m] of both fins on a body that is held, body frame."""
    yaw_rate: float
    """Mean of the first `TURN` after the change, from straight cruise [degrees/s], positive to the left."""
    speed: float
    """Forward speed at the end [m/s]."""
    pitch: float
    """Mean angle at the end [degrees], positive with the nose down, about y."""
    roll: float
    """Mean angle at the end [degrees], positive with the left side up, about x."""
    climb: float
    """Mean vertical velocity after the change [m/s], positive upward."""


def gait(
    amplitude: float = 0.0, frequency: float = 0.0, phase: float = 0.0, front_bias: float = 0.0, rear_bias: float = 0.0,
) -> FinCommand:
    """Return the gait before the change plus these values [degrees, Hz]."""
    return FinCommand(
        amplitude=math.radians(AMPLITUDE + amplitude), frequency=FREQUENCY + frequency,
        phase=math.radians(PHASE + phase), front_bias=math.radians(front_bias), rear_bias=math.radians(rear_bias))


def response(parameters: Parameters, change: Change, done: Done) -> Response:
    """Simulate a change of the gait, with the body held and with the robot free; call `done` at the end."""
    left, right = change.commands
    swim = _free_swim(parameters, left, right)
    angles = np.array([Rotation.from_quat(state.orientation).as_euler('ZYX') for state in swim])
    settled = slice(-round(SETTLED / SAMPLE), None)
    done()
    return Response(
        change=change, wrench=_held_wrench(parameters, left, right), yaw_rate=_yaw_rate(swim),
        speed=float(np.mean([state.twist[0] for state in swim[settled]])),
        pitch=math.degrees(np.mean(angles[settled, 1])), roll=math.degrees(np.mean(angles[settled, 2])),
        climb=float(swim[-1].position[2] - swim[0].position[2]) / SWIM,
    )


def yaw_rate(parameters: Parameters, chains: int, change: Change, done: Done) -> float:
    """Return the yaw rate of `Response` with another number of chains, and with a time step that is stable with it."""
    sized = parameters.replace(fin={'chains': chains})
    while sized.solver.time_step > largest_stable_step(sized, *change.commands):
        sized = sized.replace(solver={'time_step': 0.5 * sized.solver.time_step})
    rate = _yaw_rate(_free_swim(sized, *change.commands, duration=TURN))
    done()
    return rate


def cruise_speed(parameters: Parameters, amplitude: float, frequency: float, done: Done) -> float:
    """Return the mean forward speed [m/s] of a straight gait [degrees, Hz] in two periods of its cruise."""
    both = gait(amplitude - AMPLITUDE, frequency - FREQUENCY)
    simulator = Simulator(parameters)
    simulator.command(left=both, right=both)
    simulator.advance(2.0 * CRUISE)
    cruise = _samples(simulator, 2.0 / frequency)
    done()
    return float(np.mean([state.twist[0] for state in cruise]))


def _held_wrench(parameters: Parameters, left: FinCommand, right: FinCommand) -> FloatArray:
    simulator = Simulator(parameters.replace(solver={'fixed_base': True}))
    simulator.command(left=left, right=right)
    simulator.advance(TRANSIENT)
    return np.asarray(np.mean([state.wrench for state in _samples(simulator, AVERAGED)], axis=0))


def _free_swim(parameters: Parameters, left: FinCommand, right: FinCommand, duration: float = SWIM) -> list[State]:
    simulator = Simulator(parameters)
    simulator.command(left=gait(), right=gait())
    simulator.advance(CRUISE)
    simulator.command(left=left, right=right)
    return _samples(simulator, duration)


def _yaw_rate(swim: list[State]) -> float:
    angles = [Rotation.from_quat(state.orientation).as_euler('ZYX')[0] for state in swim[:round(TURN / SAMPLE)]]
    return math.degrees(np.unwrap(angles)[-1]) / TURN


def _samples(simulator: Simulator, duration: float) -> list[State]:
    return [simulator.advance(SAMPLE) for _ in range(round(duration / SAMPLE))]
