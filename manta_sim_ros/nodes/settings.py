"""All parameters of the simulator node, checked as a whole. Free of ROS."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

from manta_sim_ros.dynamics import ParameterGroup, Parameters, Quantity, Vector, quantity, shown
from manta_sim_ros.sensors import BODY_FRAME, Imu, OdometryNoise, Pressure, Velocity

FARTHEST = 1e6
"""Bound of the coordinates of a position [m]: a double resolves a tenth of a nanometer there."""

HIGHEST_RATE_TOLERANCE = 1e-9
"""Share by which `publish_rate` may be above one output per time step: rounding."""

LARGEST_OUTPUT = 1e8
"""Largest number of time steps of single links in one output: seconds, as a step takes 30 to 90 ns for each link."""

ROUNDING = 1e-6
"""Tolerance of a number of steps: far above its rounding errors and far below one step."""


def whole_steps(duration: float, time_step: float, name: str = 'step_duration') -> int:
    """Return the number of time steps [s] in a duration [s], which has a name in the error.

    Raises
    ------
    ValueError
        It is not a whole number.

    """
    steps = round(duration / time_step)
    if steps < 1 or abs(steps - duration / time_step) > ROUNDING:
        raise ValueError(
            f'{name} is {duration} s, but must be a whole number of time steps, and solver.time_step is '
            f'{time_step} s')
    return steps


def check_frame(name: str, frame: str) -> None:
    """Raise a ValueError, with the name of the parameter, if tf2 does not accept the name of a frame."""
    if frame.startswith('/') or frame != ''.join(frame.split()):
        raise ValueError(f'{name} is {shown(frame)}, but must be a name without a leading / and without spaces')


@dataclasses.dataclass(frozen=True)
class NodeParameters(ParameterGroup):
    """The parameters of the node itself."""

    publish_rate: float = quantity(
        100.0, unit='Hz', low=0.1, high=1000.0, live=True,
        description='rate of all outputs in simulated time, at most one per time step', source='chosen',
    )
    real_time_factor: float = quantity(
        1.0, low=0.0, high=1000.0, live=True,
        description='simulated time over elapsed time; 0 runs as fast as possible', source='chosen',
    )
    publish_clock: bool = quantity(
        True,
        description='publish /clock; if false and use_sim_time is true, follow that of another simulator, else stamp '
                    'messages with the clock of the node',
        source='chosen',
    )
    start_paused: bool = quantity(
        False,
        description='start paused: simulated time stands still until ~/pause is called with false', source='chosen',
    )
    initial_position: Vector = quantity(
        (0.0, 0.0, 0.0), unit='m', low=-FARTHEST, high=FARTHEST,
        description='position at the start and after a reset, world frame [x, y, z]', source='chosen',
    )
    initial_yaw: float = quantity(
        0.0, unit='rad', low=-7.0, high=7.0,
        description='heading at the start and after a reset, about the vertical; positive to the left', source='chosen',
    )
    step_duration: float = quantity(
        0.01, unit='s', low=1e-7, high=3600.0, live=True,
        description='simulated time of one ~/step, a whole number of time steps', source='chosen',
    )
    command_timeout: float = quantity(
        0.0, unit='s', low=0.0, high=3600.0, live=True,
        description='simulated time without a fin_command after which the amplitudes go to zero; 0 disables this',
        source='chosen',
    )
    body_wrench_lifetime: float = quantity(
        0.5, unit='s', low=0.0, high=3600.0, live=True,
        description='simulated time for which a body_wrench acts; with 0 it acts until the next one', source='chosen',
    )
    joint_state_rate: float = quantity(
        50.0, unit='Hz', low=0.1, high=1000.0, live=True,
        description='rate of joint_states in simulated time, at most publish_rate', source='chosen',
    )
    publish_fin_joints: bool = quantity(
        False, live=True,
        description='publish the joints of supports and chains in joint_states, beside the four rods', source='chosen',
    )
    marker_rate: float = quantity(
        10.0, unit='Hz', low=1.0, high=1000.0, live=True,
        description='rate of fin_markers in simulated time, at most publish_rate; none without a subscriber',
        source='chosen',
    )
    publish_tf: bool = quantity(
        True,
        description='publish the transform from odom_frame to base_frame, if tf2_msgs is installed', source='chosen',
    )
    publish_ned: bool = quantity(
        False,
        description='publish pose_ned and odom_ned, north east down, and the static transforms to their frames',
        source='REP 103',
    )
    odom_frame: str = quantity(
        'odom',
        description='name of the world frame', source='REP 105',
    )
    base_frame: str = quantity(
        'base_link',
        description='name of the body frame', source='REP 105',
    )

    @property
    def odom_frame_ned(self) -> str:
        """Name of the world frame with the axes north, east and down."""
        return f'{self.odom_frame}_ned'

    @property
    def base_frame_frd(self) -> str:
        """Name of the body frame with the axes forward, right and down."""
        return f'{self.base_frame}_frd'

    @property
    def pace(self) -> float:
        """Outputs per elapsed second [1/s]; 0 means as many as possible."""
        return self.publish_rate * self.real_time_factor

    def __post_init__(self) -> None:
        """Check each field, then that the frames have different names that tf2 accepts."""
        super().__post_init__()
        for name in ('odom_frame', 'base_frame'):
            check_frame(name, getattr(self, name))
        if self.odom_frame == self.base_frame:
            raise ValueError(f'base_frame is {shown(self.base_frame)}, but must differ from odom_frame')


@dataclasses.dataclass(frozen=True)
class Settings:
    """The parameters of the model, of the sensors, and of the node itself.

    Raises
    ------
    ValueError
        The publish rate asks for more than one output a time step, or for an output that takes too long, or the frame
        of the IMU has the name of another one.

    """

    model: Parameters = Parameters()
    imu: Imu = Imu()
    pressure: Pressure = Pressure()
    velocity: Velocity = Velocity()
    odom_noise: OdometryNoise = OdometryNoise()
    node: NodeParameters = NodeParameters()

    def __post_init__(self) -> None:
        """Check what concerns model, sensors and node."""
        self._check_imu_frame()
        fin, time_step = self.model.fin, self.model.solver.time_step
        highest = 1.0 / time_step
        if self.node.publish_rate > highest * (1.0 + HIGHEST_RATE_TOLERANCE):
            raise ValueError(
                f'publish_rate is {self.node.publish_rate:g} Hz, but must be at most {highest:g} Hz, '
                'one output per solver.time_step'
            )
        lowest = 2 * fin.chains * fin.links / (LARGEST_OUTPUT * time_step)
        if self.node.publish_rate < lowest:
            raise ValueError(
                f'publish_rate is {self.node.publish_rate:g} Hz, but must be at least {lowest:.3g} Hz with this '
                'solver.time_step and these fin.chains and fin.links: during one output, nobody else is heard'
            )

    @property
    def imu_frame(self) -> str:
        """Name of the frame of the IMU."""
        return self.node.base_frame if self.imu.frame == BODY_FRAME else self.imu.frame

    def _check_imu_frame(self) -> None:
        own, frame = self.node, self.imu_frame
        check_frame('imu.frame', frame)
        for name, other in (('odom_frame', own.odom_frame), ('the NED frame', own.odom_frame_ned),
                            ('the FRD frame', own.base_frame_frd)):
            if frame == other:
                raise ValueError(f'imu.frame is {shown(frame)}, but must differ from {name}')
        if frame == own.base_frame and self.imu.is_displaced:
            raise ValueError(
                f'imu.frame is {shown(self.imu.frame)}, but must be the name of another frame than the body frame with '
                'these imu.position and imu.orientation')

    @classmethod
    def quantities(cls) -> dict[str, Quantity]:
        """Return what is known about each parameter by its full name, such as `fin.span` or `publish_rate`."""
        groups: dict[str, type[ParameterGroup]] = {
            **Parameters.groups(), 'imu': Imu, 'pressure': Pressure, 'velocity': Velocity, 'odom_noise': OdometryNoise,
            '': NodeParameters}
        return {
            f'{group}.{name}' if group else name: about for group, kind in groups.items()
            for name, about in kind.quantities().items()}

    def value(self, full_name: str) -> Any:
        """Return the value of a parameter by its full name."""
        group, _, name = full_name.rpartition('.')
        owner = self.model if group in self.model.groups() else self
        return getattr(getattr(owner, group or 'node'), name)

    def replace(self, values: Iterable[tuple[str, Any]]) -> Settings:
        """Return settings with other values, given by full names.

        Raises
        ------
        ValueError
            A value is invalid; names it and the bound.

        """
        groups: dict[str, dict[str, Any]] = {}
        for full_name, value in values:
            group, _, name = full_name.rpartition('.')
            groups.setdefault(group or 'node', {})[name] = value
        model = self.model.replace(**{name: groups.pop(name) for name in self.model.groups() if name in groups})
        others = {name: dataclasses.replace(getattr(self, name), **values) for name, values in groups.items()}
        replaced = dataclasses.replace(self, model=model, **others)
        if 'step_duration' in groups.get('node', {}):  # the default need not fit any time step
            whole_steps(replaced.node.step_duration, model.solver.time_step)
        return replaced
