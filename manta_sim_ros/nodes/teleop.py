"""The node `manta_teleop`: drives the robot by hand with `fin_command`, from the keys of a terminal and from `joy`."""

from __future__ import annotations

import importlib.util
import math
import threading
import time
from collections.abc import Iterator

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.qos import qos_profile_sensor_data
from rclpy.task import Future
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Float64MultiArray

from manta_sim_ros.control.averaging import PeriodAverage
from manta_sim_ros.control.closed_loop import CONTROL_PERIOD
from manta_sim_ros.control.gaits import Gaits
from manta_sim_ros.control.joystick import JoystickSettings, demand_of
from manta_sim_ros.control.manual import ManualControl, ManualSettings
from manta_sim_ros.control.teleop_view import View
from manta_sim_ros.control.teleoperation import Teleoperation
from manta_sim_ros.dynamics import Parameters, shown
from manta_sim_ros.nodes.messages import ROD_NAMES, odometry_of, seconds
from manta_sim_ros.nodes.parameters import ParameterNode, declare_group, declare_value
from manta_sim_ros.nodes.process import run_node
from manta_sim_ros.nodes.qos import publisher, subscription
from manta_sim_ros.nodes.refusals import Refusals
from manta_sim_ros.nodes.terminal import Terminal, is_terminal

SILENCE = 2.0
"""Age from which on what was heard counts as old [s]."""

OLD_DIAGNOSTICS = 3.0
"""Age from which on diagnostics are not shown any more [s]; they come once a second."""

DELIVERY_LIMIT = 0.3
"""Longest time to wait until all subscribers have the last command [s]."""


class TeleopNode(ParameterNode):
    """Publishes what the keys or a joystick ask for, ten times a second from the first key or dead-man button on.

    Its methods may be called in any thread.

    Raises
    ------
    ValueError
        A parameter is invalid, or Textual is not installed, but a screen is asked for.

    """

    def __init__(self) -> None:
        super().__init__('manta_teleop')
        self.settings = declare_group(self, ManualSettings)
        self._joystick = declare_group(self, JoystickSettings)
        robot = declare_value(
            self, 'robot', '', 'parameter file of the robot, whose mechanism limits the gaits; empty: the defaults')
        wanted = declare_value(
            self, 'screen', True, 'show a screen and listen to the keys, where there is a terminal; else joy only')
        self.has_screen: bool = wanted and is_terminal()
        """Whether there shall be a screen."""
        if self.has_screen and importlib.util.find_spec('textual') is None:
            raise ValueError(
                "the screen needs the extra 'control': pip install 'manta_sim_ros[control]'; or say screen:=false to "
                'drive with joy alone')
        try:
            parameters = Parameters.from_yaml(robot) if robot else Parameters()
        except OSError as error:
            raise ValueError(f'robot {shown(robot)}: {error}') from error
        self._lock = threading.RLock()
        self._teleoperation = Teleoperation(ManualControl(self.settings, parameters), self._joystick)
        self._stopped = False
        self._motion = PeriodAverage(1.0 / self.settings.frequency)
        self._stamp = math.nan  # simulated time [s]
        self._rods = np.full((2, 2), math.nan)
        self._odom_heard = self._diagnostics_heard = self._bad_joy_heard = -math.inf  # steady time [s]
        self._diagnostics: list[DiagnosticStatus] = []
        self._bad_joy = Refusals(self.get_logger().warning, 'joy', 'it is not used')
        self._bad_odometry = Refusals(self.get_logger().warning, 'odom', 'it is not used')
        self._publisher = publisher(self, 'fin_command')
        if self.has_screen:
            subscription(self, 'odom', self._take_odometry)
            subscription(self, 'joint_states', self._take_joints)
            subscription(self, '/diagnostics', self._take_diagnostics)
        else:
            self.get_logger().info('no screen and no keys: joy commands' if not wanted else
                                   'there is no terminal, so no screen and no keys: joy commands')
        self.create_subscription(Joy, 'joy', self._take_joy, qos_profile_sensor_data)
        self._timer = self.create_timer(CONTROL_PERIOD, self._command, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.warn_of_unknown_parameters()

    def press(self, action: str) -> None:
        """Do what a key does, an action of `KEYS`."""
        with self._lock:
            self._teleoperation.press(action)
            self._command()

    def stop(self) -> None:
        """Stop the fins, if they were commanded; nothing is commanded afterwards."""
        with self._lock:
            active, self._stopped = self._teleoperation.active and not self._stopped, True
            if active:
                self._publish(self._teleoperation.stop())
        if active:
            self._publisher.wait_for_all_acked(Duration(seconds=DELIVERY_LIMIT))

    def view(self) -> View:
        """Return what the screen shows."""
        with self._lock:
            now, teleoperation = time.monotonic(), self._teleoperation
            speed, depth, attitude = math.nan, math.nan, np.full(3, math.nan)
            if not math.isnan(self._stamp):
                motion = self._motion.mean
                speed, depth, attitude = float(motion.twist[0]), 0.0 - float(motion.position[2]), motion.attitude
            diagnostics = self._diagnostics if now - self._diagnostics_heard < OLD_DIAGNOSTICS else []
            pace = next((status.message for status in diagnostics
                         if status.name.endswith(': pace') and status.level == DiagnosticStatus.OK), '')
            return View(
                self._publisher.topic_name, self._stamp, speed, depth, attitude, teleoperation.demand,
                teleoperation.held, teleoperation.gaits, self._rods, pace, tuple(self._troubles(now, diagnostics)))

    def _take_odometry(self, message: Odometry) -> None:
        try:
            motion = odometry_of(message)
        except ValueError as error:
            self._bad_odometry.add(error)
            return
        with self._lock:
            self._odom_heard, self._stamp = time.monotonic(), seconds(message.header.stamp)
            self._motion.add(self._stamp, *motion)

    def _take_joints(self, message: JointState) -> None:
        angles = dict(zip(message.name, message.position, strict=False))
        with self._lock:
            self._rods = np.reshape([angles.get(name, math.nan) for name in ROD_NAMES], (2, 2))

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        """Keep what is said of a simulator in the namespace of this node."""
        namespace = self.get_namespace().rstrip('/')
        here = [status for status in message.status if status.name.startswith(f'{namespace}/')
                and '/' not in status.name.partition(':')[0].removeprefix(f'{namespace}/')]
        if here:
            with self._lock:
                self._diagnostics, self._diagnostics_heard = here, time.monotonic()

    def _take_joy(self, message: Joy) -> None:
        try:
            demand = demand_of(self._joystick, message.axes, message.buttons)
        except ValueError as error:
            self._bad_joy.add(error)
            self._bad_joy_heard = time.monotonic()
            return
        with self._lock:
            self._teleoperation.hear(demand, time.monotonic())

    def _command(self) -> None:
        with self._lock:
            gaits = self._teleoperation.command(time.monotonic())
            if gaits is not None and not self._stopped:
                self._publish(gaits)

    def _publish(self, gaits: Gaits) -> None:
        left, right = (gait.as_array() for gait in gaits)
        self._publisher.publish(Float64MultiArray(data=np.column_stack([left, right]).ravel().tolist()))

    def _troubles(self, now: float, diagnostics: list[DiagnosticStatus]) -> Iterator[str]:
        topic, odom = self._publisher.topic_name, self.resolve_topic_name('odom')
        if self._publisher.get_subscription_count() == 0:
            yield f'no simulator: nobody subscribes to {topic}'
        elif self.count_publishers(topic) > 1:
            yield f'another node publishes {topic}, too'
        if math.isinf(self._odom_heard):
            yield f'waiting for {odom}'
        elif now - self._odom_heard > SILENCE:
            yield f'no {odom} for {now - self._odom_heard:.0f} s'
        if self._teleoperation.trouble:
            yield self._teleoperation.trouble
        if now - self._bad_joy_heard < SILENCE:
            yield f'joy is not used: {self._bad_joy.take().reason}'
        for status in diagnostics:
            if status.level != DiagnosticStatus.OK:
                yield status.message


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted, or until the user leaves the screen."""
    terminal = Terminal()

    def spin(node: TeleopNode, ending: Future[None]) -> None:
        if node.has_screen:
            from manta_sim_ros.control.teleop_screen import TeleopScreen

            terminal.run(node, TeleopScreen(node.view, node.press, node.settings))
        else:
            rclpy.spin_until_future_complete(node, ending)

    def finish(node: TeleopNode) -> None:
        node.stop()
        terminal.close()

    run_node(TeleopNode, lambda node: None, spin, args, finish)
