"""The node `manta_monitor`: prints one line per second about the robot, from the topic `odom`."""

from __future__ import annotations

import math
import time

import rclpy
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import Odometry
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from scipy.spatial.transform import Rotation

from manta_sim_ros.nodes.parameters import declare_value
from manta_sim_ros.nodes.process import run_node
from manta_sim_ros.nodes.qos import subscription

LINE_PERIOD = 1.0
HEADINGS = '    time   speed  heading   depth  real-time\n       s     m/s      deg       m     factor'


def heading_of(orientation: Quaternion) -> float:
    """Return the heading of an orientation [degrees]: 0 along the world's x, positive to the left."""
    quaternion = (orientation.x, orientation.y, orientation.z, orientation.w)
    return float(Rotation.from_quat(quaternion).as_euler('ZYX', degrees=True)[0])


def seconds(message: Odometry) -> float:
    """Return the stamp [s]."""
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


class MonitorNode(Node):
    """Prints time, mean forward speed of the last second, heading, depth and the real-time factor.

    Raises
    ------
    ValueError
        A parameter has an invalid value.

    """

    def __init__(self) -> None:
        super().__init__('manta_monitor', automatically_declare_parameters_from_overrides=True)
        self._duration: float = declare_value(
            self, 'duration', 0.0, 'elapsed time after the first message at which the node ends [s]; 0 for never')
        if not 0.0 <= self._duration < math.inf:
            raise ValueError(f'duration is {self._duration} s, but must be finite and at least 0')
        self._speeds: list[float] = []
        self._latest: Odometry | None = None
        self._waiting = False
        self._began = math.nan
        self._line_before = math.nan, math.nan  # elapsed and simulated time [s]
        subscription(self, 'odom', self._take)
        self._timer = self.create_timer(LINE_PERIOD, self._print, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _take(self, message: Odometry) -> None:
        if self._latest is None:
            print(HEADINGS, flush=True)
            self._began = time.monotonic()
            self._line_before = self._began, seconds(message)
            self._timer.reset()
        self._latest = message
        self._speeds.append(message.twist.twist.linear.x)

    def _print(self) -> None:
        now = time.monotonic()
        if self._latest is None:
            if not self._waiting:
                self._waiting = True
                print(f'waiting for {self.resolve_topic_name("odom")}', flush=True)
            return
        pose = self._latest.pose.pose
        elapsed_before, simulated_before = self._line_before
        simulated = seconds(self._latest)
        speed = sum(self._speeds) / len(self._speeds) if self._speeds else math.nan
        heading = heading_of(pose.orientation)
        factor = (simulated - simulated_before) / (now - elapsed_before)
        print(f'{simulated:8.2f} {speed:7.3f} {heading:8.1f} {0.0 - pose.position.z:7.3f} {factor:10.2f}', flush=True)
        self._speeds.clear()
        self._line_before = now, simulated
        if self._duration > 0.0 and now - self._began >= self._duration - 0.5 * LINE_PERIOD:
            raise KeyboardInterrupt  # as for Ctrl-C


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted, or for its duration."""
    run_node(MonitorNode, lambda node: None, rclpy.spin, args)
