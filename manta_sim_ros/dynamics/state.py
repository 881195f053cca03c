"""The state of a simulation, frozen: the beginning and the result of a step."""

from __future__ import annotations

import dataclasses
import functools
import numbers
import operator
from collections.abc import Sequence
from typing import Any

import numpy as np

from manta_sim_ros.dynamics._kernels.geometry import rotation_of
from manta_sim_ros.dynamics._kernels.motion import Motion, motion_of, motion_size
from manta_sim_ros.dynamics.parameters import Parameters, check_parameters
from manta_sim_ros.dynamics.quantity import FloatArray, real_array, shown

SHAPES: dict[str, tuple[int, ...]] = {
    'position': (3,),
    'orientation': (4,),
    'twist': (6,),
    'acceleration': (6,),
    'rod_angles': (2, 2),
    'fin_wrenches': (2, 6),
    'gait': (2, 5),
    'gait_rates': (2, 5),
    'gait_commands': (2, 5),
    'cycle_angles': (2,),
    'current_deviation': (3,),
    'rod_rates': (2, 2),
    'rod_torques': (2, 2),
}
"""Shapes of the arrays of a state; joint_angles and joint_rates are (2, n, m)."""

LONGEST_TIME = 1e12
"""Bound of the time of a state [s]: beyond it a float cannot represent single steps."""

MOST_STEPS = 2**53
"""The largest number of steps: a float cannot count more."""

UNIT_TOLERANCE = 1e-6
"""Largest difference of the norm of an orientation from 1: the rounding of a printed value."""


@dataclasses.dataclass(frozen=True, eq=False)
class State:
    """State of the robot at one time. Arrays are read-only; fin index 0 is left, 1 is right. SI units, radians.

    Components are in the body frame (x forward, y left, z up, origin at the center of mass) unless stated otherwise.

    Raises
    ------
    ValueError
        An array has a wrong shape, a value is not finite, or the orientation is not a unit quaternion.

    """

    time: float
    """Simulated time [s]."""
    position: FloatArray
    """(3,) of the center of mass, world frame [m]."""
    orientation: FloatArray
    """(4,) unit quaternion x, y, z, w: body to world components."""
    twist: FloatArray
    """(6,) V [m/s], Omega [rad/s]."""
    acceleration: FloatArray
    """(6,) time derivative of the components of the twist [m/s^2, rad/s^2]. With the staggered coupling it is that of
    the last step, which the fins see in the next step; with the monolithic coupling it is that at `time`, once a step
    was taken."""
    joint_angles: FloatArray
    """(2, n, m) by fin, chain and link [rad], positive with the tip up on both sides."""
    joint_rates: FloatArray
    """(2, n, m) [rad/s]."""
    rod_angles: FloatArray
    """(2, 2) by fin and rod (front, rear) [rad]."""
    fin_wrenches: FloatArray
    """(2, 6) force [N] and moment [N m] of each fin on the body about its center of mass, at the end of the step."""
    gait: FloatArray
    """(2, 5) smoothed amplitude [rad], frequency [Hz], phase, front bias and rear bias [rad] of each fin."""
    gait_rates: FloatArray
    """(2, 5) time derivative of `gait`."""
    gait_commands: FloatArray
    """(2, 5) the last command, which `gait` approaches."""
    cycle_angles: FloatArray
    """(2,) angle psi of each fin in its cycle, [0, 2 pi) [rad]."""
    start_time: float = 0.0
    """Time from which the steps are counted [s]: the time is a product, in which rounding errors do not add up."""
    step_count: int = 0
    """Steps since `start_time`."""
    current_deviation: FloatArray = dataclasses.field(default_factory=lambda: np.zeros(3))
    """(3,) present deviation of the current from its mean, world frame [m/s]."""
    rod_rates: FloatArray = dataclasses.field(default_factory=lambda: np.zeros((2, 2)))
    """(2, 2) by fin and rod (front, rear), positive upward on both sides [rad/s], at the end of the step."""
    rod_torques: FloatArray = dataclasses.field(default_factory=lambda: np.zeros((2, 2)))
    """(2, 2) by fin and rod (front, rear), of the motors on the rods, positive upward [N m], at the end of the step."""
    servos: bool = False
    """Whether servos turn the rods to `rod_command`, in place of gaits. Both are then the biases of `gait_commands` and
    `gait`, whose amplitudes and frequencies are 0."""

    def __post_init__(self) -> None:
        """Copy the arrays, make them read-only, and check them."""
        for name in ('time', 'start_time'):
            value: Any = getattr(self, name)
            real = isinstance(value, numbers.Real) and not isinstance(value, bool)
            if not (real and -LONGEST_TIME < value < LONGEST_TIME):
                raise ValueError(
                    f'state.{name} is {shown(value)}, but must be a finite number within {LONGEST_TIME:g} s')
            object.__setattr__(self, name, float(value))
        count = self.step_count
        whole = isinstance(count, numbers.Integral) and not isinstance(count, bool)
        if not (whole and 0 <= count <= MOST_STEPS):
            raise ValueError(
                f'state.step_count is {shown(count)}, but must be a whole number from 0 to {MOST_STEPS}')
        if not isinstance(self.servos, bool):
            raise ValueError(f'state.servos is {shown(self.servos)}, but must be true or false')
        for field in dataclasses.fields(self):
            if field.name in SHAPES or field.name in ('joint_angles', 'joint_rates'):
                object.__setattr__(self, field.name, self._checked_array(field.name))
        if self.joint_angles.ndim != 3 or self.joint_angles.shape[0] != 2:
            raise ValueError(f'state.joint_angles has shape {self.joint_angles.shape}, but must have (2, n, m)')
        if self.joint_rates.shape != self.joint_angles.shape:
            raise ValueError(
                f'state.joint_rates has shape {self.joint_rates.shape}, but must have that of joint_angles, '
                f'{self.joint_angles.shape}'
            )
        for name in ('gait', 'gait_rates', 'gait_commands'):
            if self.servos and np.any(getattr(self, name)[:, :3]):
                first = getattr(self, name)[:, :3].tolist()
                raise ValueError(f'state.{name} has {first}, but must have zeros with servos')
        norm = float(np.linalg.norm(self.orientation))
        if not abs(norm - 1.0) <= UNIT_TOLERANCE:
            raise ValueError(f'state.orientation has norm {norm:.9g}, but must have 1 within {UNIT_TOLERANCE:g}')

    def __reduce__(self) -> tuple[type[State], tuple[Any, ...]]:
        """Let the constructor make copies and unpickled states, so that they are read-only and checked as well."""
        return type(self), tuple(getattr(self, field.name) for field in dataclasses.fields(self))

    def _checked_array(self, name: str) -> FloatArray:
        array = real_array(f'state.{name}', getattr(self, name))
        if name in SHAPES and array.shape != SHAPES[name]:
            raise ValueError(f'state.{name} has shape {array.shape}, but must have {SHAPES[name]}')
        if not np.isfinite(array).all():
            raise ValueError(f'state.{name} must be finite, but has {array[~np.isfinite(array)][0]}')
        array.setflags(write=False)
        return array

    @property
    def wrench(self) -> FloatArray:
        """(6,) sum of `fin_wrenches`: force [N] and moment [N m] of both fins on the body."""
        return self.fin_wrenches[0] + self.fin_wrenches[1]

    @property
    def up(self) -> FloatArray:
        """(3,) the z axis of the world frame in the body frame."""
        return np.array(rotation_of.py_func(self.orientation.tolist())[2])

    @property
    def rod_command(self) -> FloatArray | None:
        """(2, 2) by fin and rod (front, rear): the angles that servos turn the rods to [rad]; None with gaits."""
        return self.gait_commands[:, 3:] if self.servos else None

    @property
    def rod_power(self) -> float:
        """Power of the motors of all rods into the fins [W], at the end of the step."""
        torques, rates = self.rod_torques.ravel().tolist(), self.rod_rates.ravel().tolist()  # faster than arrays
        return sum(map(operator.mul, torques, rates))

    @classmethod
    def unchecked(cls, motion: FloatArray, joints: tuple[int, ...], **others: Any) -> State:
        """Return a state without copies and without checks, of valid arrays that nobody else holds.

        Parameters
        ----------
        motion
            (motion_size,) all arrays of `Motion`, as `motion_of` finds them.
        joints
            (2, n, m).
        others
            All fields that are not in `Motion`.

        """
        state = object.__new__(cls)
        motion.setflags(write=False)
        others['current_deviation'].setflags(write=False)
        fields = state.__dict__
        fields.update(others)
        for name, part, shape in _places(*joints[1:]):
            fields[name] = motion[part] if shape is None else motion[part].reshape(shape)
        return state

    def motion_values(self) -> FloatArray:
        """Return all arrays of `Motion` in a new one, as `motion_of` finds them."""
        return np.concatenate([getattr(self, name).ravel() for name in Motion._fields])

    @classmethod
    def at_rest(cls, parameters: Parameters) -> State:
        """Return the state at rest at the origin at time 0, with both fins flat and without a gait."""
        fin = parameters.fin
        zeros: dict[str, Any] = {name: np.zeros(shape) for name, shape in SHAPES.items()}
        zeros['orientation'][3] = 1.0
        joints = np.zeros((2, fin.chains, fin.links))
        return cls(time=0.0, joint_angles=joints, joint_rates=joints, **zeros)


@functools.lru_cache(maxsize=16)
def _places(chains: int, links: int) -> list[tuple[str, slice, tuple[int, ...] | None]]:
    """Return the name of each array of `Motion`, its part of their values, and its shape if that is not the part's."""
    places = []
    for name, array in motion_of.py_func(np.arange(motion_size(chains, links)), chains, links)._asdict().items():
        first = int(array.flat[0])
        places.append((name, slice(first, first + array.size), array.shape if array.ndim > 1 else None))
    return places


def check_shape(parameters: Parameters, state: State) -> None:
    """Raise a ValueError if these are no parameters and no state, or of other numbers of chains and links."""
    check_parameters(parameters)
    if not isinstance(state, State):
        raise ValueError(f'state is {shown(state)}, but must be a State')
    fin = parameters.fin
    expected = (2, fin.chains, fin.links)
    if state.joint_angles.shape != expected:
        raise ValueError(
            f'state.joint_angles has shape {state.joint_angles.shape}, but fin.chains and fin.links ask for {expected}')


def finite_array(name: str, values: Sequence[float] | FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return `values` as a new array of this shape, or raise a ValueError that names what is wrong."""
    array = real_array(name, values)
    if array.shape != shape:
        raise ValueError(f'{name} has shape {array.shape}, but must have {shape}')
    if not np.isfinite(array).all():
        raise ValueError(f'{name} must be finite, but has {array[~np.isfinite(array)][0]}')
    return array
