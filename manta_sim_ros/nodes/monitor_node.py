"""The node `manta_monitor`: prints one line per second about the robot, from `odom` and `joint_states`."""

from __future__ import annotations

import math
import time

import rclpy
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import Odometry
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from manta_sim_ros.nodes.messages import rod_power_of, seconds
from manta_sim_ros.nodes.parameters import ParameterNode, declare_value
from manta_sim_ros.nodes.process import run_node
from manta_sim_ros.nodes.qos import subscription
from manta_sim_ros.nodes.transport import energy_per_distance

LINE_PERIOD = 1.0  # s, as below
SILENCE = 2.0
HEADINGS = (
    '    time   speed  heading   depth  real-time   power  energy\n'
    '       s     m/s      deg       m     factor       W     J/m')


def heading_of(orientation: Quaternion) -> float:
    """Return the heading of an orientation [degrees]: 0 along the world's x, positive to the left."""
    quaternion = (orientation.x, orientation.y, orientation.z, orientation.w)
    return float(Rotation.from_quat(quaternion).as_euler('ZYX', degrees=True)[0])


def mean(values: list[float]) -> float:
    """Return the mean, NaN of none."""
    return sum(values) / len(values) if values else math.nan


def cell(value: float, width: int, digits: int) -> str:
    """Return a number with a width and a number of decimals, a dash for NaN."""
    return ('-' if math.isnan(value) else f'{round(value, digits) + 0.0:.{digits}f}').rjust(width)  # no negative zero


class MonitorNode(ParameterNode):
    """Prints time, heading, depth, real-time factor, and means of the last second: speed, power, energy per distance.

    The power is that of the motors of the rods into the fins, from the efforts and velocities of `joint_states`. A dash
    stands for what is not known.

    Raises
    ------
    ValueError
        A parameter has an invalid value.

    """

    def __init__(self) -> None:
        super().__init__('manta_monitor')
        self._duration: float = declare_value(
            self, 'duration', 0.0, 'elapsed time after the first message at which the node ends [s]; 0 for never')
        if not 0.0 <= self._duration < math.inf:
            raise ValueError(f'duration is {self._duration} s, but must be finite and at least 0')
        self._speeds: list[float] = []
        self._powers: list[float] = []
        self._latest: Odometry | None = None
        self._waiting = False
        self._restarted_from = math.nan  # simulated time [s] before it went back
        self._began = self._heard = math.nan  # steady time [s]
        self._line_before = math.nan, math.nan  # steady and simulated time [s]
        subscription(self, 'odom', self._take)
        subscription(self, 'joint_states', self._take_joints)
        self._timer = self.create_timer(LINE_PERIOD, self._print, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.warn_of_unknown_parameters()

    def _take(self, message: Odometry) -> None:
        self._heard = time.monotonic()
        if self._latest is None:
            print(HEADINGS, flush=True)
            self._began = self._heard
            self._begin_line(seconds(message.header.stamp))
            self._timer.reset()
        elif seconds(message.header.stamp) < seconds(self._latest.header.stamp):
            if math.isnan(self._restarted_from):
                self._restarted_from = seconds(self._latest.header.stamp)
            self._begin_line(seconds(message.header.stamp))
        self._latest = message
        self._speeds.append(message.twist.twist.linear.x)

    def _take_joints(self, message: JointState) -> None:
        power = rod_power_of(message)
        if self._latest is not None and math.isfinite(power):  # of the same time as the speeds
            self._powers.append(power)

    def _begin_line(self, simulated: float) -> None:
        """Begin the time of the next line, at this simulated time [s]."""
        self._speeds.clear()
        self._powers.clear()
        self._line_before = time.monotonic(), simulated

    def _print(self) -> None:
        now = time.monotonic()
        topic = self.resolve_topic_name('odom')
        if self._latest is None:
            if not self._waiting:
                self._waiting = True
                print(f'waiting for {topic}', flush=True)
            return
        simulated = seconds(self._latest.header.stamp)
        if not math.isnan(self._restarted_from):
            print(f'time went back from {self._restarted_from:.1f} s to {self._line_before[1]:.1f} s: '
                  'the simulator was restarted', flush=True)
            self._restarted_from = math.nan
        if now - self._heard > SILENCE:
            print(f'no {topic} for {now - self._heard:.0f} s', flush=True)
        else:
            self._print_line(now, self._latest)
        self._begin_line(simulated)
        if self._duration > 0.0 and now - self._began >= self._duration - 0.5 * LINE_PERIOD:
            raise KeyboardInterrupt  # as for Ctrl-C

    def _print_line(self, now: float, odometry: Odometry) -> None:
        elapsed_before, simulated_before = self._line_before
        simulated, pose = seconds(odometry.header.stamp), odometry.pose.pose
        factor = (simulated - simulated_before) / (now - elapsed_before)
        speed, power = mean(self._speeds), mean(self._powers)
        print(' '.join(cell(*column) for column in (
            (simulated, 8, 2), (speed, 7, 3), (heading_of(pose.orientation), 8, 1), (0.0 - pose.position.z, 7, 3),
            (factor, 10, 2), (power, 7, 2), (energy_per_distance(power, speed), 7, 1))), flush=True)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted, or for its duration."""
    run_node(MonitorNode, lambda node: None, rclpy.spin_until_future_complete, args)
