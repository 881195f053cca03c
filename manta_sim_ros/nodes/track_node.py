"""The node `manta_track`: records how a robot swims along the path of `path_follower`, and draws it at the end."""

from __future__ import annotations

import math
import sys
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import rclpy
from nav_msgs.msg import Odometry, Path
from rclpy.client import Client
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.control.track import Track, draw
from manta_sim_ros.dynamics import shown
from manta_sim_ros.nodes.messages import seconds
from manta_sim_ros.nodes.parameters import ParameterNode, declare_value
from manta_sim_ros.nodes.path_follower import FOLLOWED_PATH, positions_of
from manta_sim_ros.nodes.process import run_node
from manta_sim_ros.nodes.qos import subscription

LOST = 60.0
"""Simulated time without progress along the path after which the track is lost [s]."""

STEPPING_PERIOD = 1.0
"""Elapsed time without a command after which simulated time is stepped all the same [s]."""


class TrackNode(ParameterNode):
    """Records `odom` from the first path on, until the path ends or the robot loses it.

    With `lockstep`, it lets simulated time go on, one `~/step` of the simulator for each command of the path follower:
    the swim is then as fast as the machine allows, and does not depend on how fast that is.

    Raises
    ------
    ValueError
        A parameter is invalid; names the value and the bound.

    """

    def __init__(self) -> None:
        super().__init__('manta_track')
        self._output: str = declare_value(self, 'output', '', 'PNG file of the figure; empty: none is drawn')
        self._farthest: float = declare_value(
            self, 'lost_distance', 5.0, 'horizontal distance from the path at which the track is lost [m]')
        lockstep: bool = declare_value(
            self, 'lockstep', False, 'step the simulator, which must be paused, for each command of the path follower')
        if not 0.1 <= self._farthest < math.inf:
            raise ValueError(f'lost_distance is {self._farthest} m, but must be finite and at least 0.1 m')
        if self._output and (FilePath(self._output).suffix != '.png' or not FilePath(self._output).parent.is_dir()):
            raise ValueError(f'output is {shown(self._output)}, but must be a .png file in a directory that exists')
        self.ended: Future[str] = Future()
        """Done when the swim has ended; its result is why the track was lost, or empty."""
        self._track: Track | None = None
        self._best, self._progressed = 0.0, math.nan  # station [m], when it grew [s]
        subscription(self, 'odom', self._take)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(Path, FOLLOWED_PATH, self._take_path, latched)
        if lockstep:
            self._step: Client[Any, Any] = self.create_client(Trigger, 'manta_sim/step')
            self._stepped = False
            subscription(self, 'fin_command', self._advance)
            self._timer = self.create_timer(
                STEPPING_PERIOD, self._advance_again, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.warn_of_unknown_parameters()

    def _take_path(self, message: Path) -> None:
        if message.poses:
            self._track, self._best, self._progressed = Track(Polyline(positions_of(message))), 0.0, math.nan
            self.get_logger().info(f'recording along a path of {self._track.path.length:.2f} m')
        elif self._track is not None:
            self.end('')

    def _take(self, message: Odometry) -> None:
        if self._track is None or self.ended.done():
            return
        position, time = message.pose.pose.position, seconds(message.header.stamp)
        station, cross_track, _ = self._track.add(time, np.array([position.x, position.y, position.z]))
        if station > self._best or math.isnan(self._progressed):
            self._best, self._progressed = station, time
        if abs(cross_track) > self._farthest:
            self.end(f'the robot is more than {self._farthest:g} m beside the path')
        elif time - self._progressed > LOST:
            self.end(f'there is no progress along the path for {LOST:g} s')

    def _advance(self, _: Float64MultiArray) -> None:
        self._stepped = True
        if self._track is not None and not self.ended.done():
            self._step.call_async(Trigger.Request())

    def _advance_again(self) -> None:
        """Step when no command came: before the first one, or when a message was lost."""
        stepped, self._stepped = self._stepped, False
        if not stepped and self._track is not None and self._step.service_is_ready():
            self._step.call_async(Trigger.Request())

    def end(self, why: str) -> None:
        """End the swim, if it has not ended yet."""
        if not self.ended.done():
            self.ended.set_result(why)

    def report(self) -> None:
        """Print the errors, and draw the figure."""
        if self._track is None or not len(self._track):
            return
        print(self._track, flush=True)
        if self._output:
            draw(self._track, FilePath(self._output))
            print(f'the path and the track are drawn in {self._output}', flush=True)


def swim(node: TrackNode, ending: Future[None]) -> None:
    """Spin until the swim has ended, then report it; the exit status is 1 if the track was lost.

    When the process is to end before, nothing is reported.
    """
    ending.add_done_callback(lambda _: node.end(''))
    rclpy.spin_until_future_complete(node, node.ended)
    if ending.done():
        return
    node.report()
    why = node.ended.result() if node.ended.done() else ''
    if why:
        sys.exit(f'track_node: the track is lost: {why}')


def main(args: list[str] | None = None) -> None:
    """Run the node until the end of the path, the loss of the track, or an interruption."""
    run_node(TrackNode, lambda node: None, swim, args)
