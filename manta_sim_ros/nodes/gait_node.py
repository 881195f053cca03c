"""The node `manta_gait`: the simplest controller. It publishes a list of gaits on `fin_command`, one after the other.

Copy it to start a controller: one topic connects it with the robot.
"""

from __future__ import annotations

import math

import rclpy
from std_msgs.msg import Float64MultiArray

from manta_sim_ros.dynamics import shown
from manta_sim_ros.nodes.messages import fin_commands
from manta_sim_ros.nodes.parameters import ParameterNode, declare_value
from manta_sim_ros.nodes.process import run_node
from manta_sim_ros.nodes.qos import publisher

GAIT_LISTS = {  # in the order of a fin_command message; defaults: straight, then a turn to the right
    'left_amplitude_degrees': ([40.0], 'amplitude of the left rear rod [degrees]'),
    'right_amplitude_degrees': ([40.0, 20.0], 'amplitude of the right rear rod [degrees]'),
    'left_frequency': ([0.6], 'flapping frequency of the left fin [Hz]'),
    'right_frequency': ([0.6], 'flapping frequency of the right fin [Hz]'),
    'left_phase_degrees': ([40.0], 'phase by which the left front rod leads [degrees]'),
    'right_phase_degrees': ([40.0], 'phase by which the right front rod leads [degrees]'),
    'left_front_bias_degrees': ([0.0], 'bias of the left front rod [degrees]'),
    'right_front_bias_degrees': ([0.0], 'bias of the right front rod [degrees]'),
    'left_rear_bias_degrees': ([0.0], 'bias of the left rear rod [degrees]'),
    'right_rear_bias_degrees': ([0.0], 'bias of the right rear rod [degrees]'),
}


def gait_at(elapsed: float, durations: list[float], repeat: bool) -> int:
    """Return the index of the gait at `elapsed` [s] after the first one began; without `repeat` the last one stays."""
    if repeat:
        elapsed %= sum(durations)
    for index, duration in enumerate(durations):
        if elapsed < duration:
            return index
        elapsed -= duration
    return len(durations) - 1


class GaitNode(ParameterNode):
    """Publishes the present gait periodically, so that a simulator that starts later receives it, too.

    Raises
    ------
    ValueError
        A parameter has an invalid value.

    """

    def __init__(self) -> None:
        super().__init__('manta_gait')
        self._durations = declare_value(self, 'durations', [15.0, 15.0], 'duration of each gait [s]')
        if not self._durations or not all(0.0 < duration < math.inf for duration in self._durations):
            raise ValueError(f'durations are {shown(self._durations)}, but must be at least one, each greater than 0 s')
        self._repeat = declare_value(self, 'repeat', True, 'start again after the last gait; else the last one stays')
        rate = declare_value(self, 'publish_rate', 10.0, 'rate of fin_command [Hz]')
        if not 0.1 <= rate <= 200.0:
            raise ValueError(f'publish_rate is {rate} Hz, but must be from 0.1 to 200 Hz')
        self._commands = self._gaits()
        self._began: float | None = None
        self._publisher = publisher(self, 'fin_command')
        self._timer = self.create_timer(1.0 / rate, self._publish)
        self.warn_of_unknown_parameters()

    def _gaits(self) -> list[list[float]]:
        """Return the data of a fin_command message for each gait."""
        count = len(self._durations)
        columns = []
        for name, (default, description) in GAIT_LISTS.items():
            values = list(declare_value(self, name, default, f'{description}, one for all gaits or one for each'))
            if len(values) not in (1, count):
                raise ValueError(f'{name} has {len(values)} values, but must have 1, or {count} as durations has')
            values = values * count if len(values) == 1 else values
            columns.append([math.radians(value) for value in values] if name.endswith('_degrees') else values)
        commands = [list(gait) for gait in zip(*columns, strict=True)]
        for index, command in enumerate(commands):
            try:
                fin_commands(command)
            except ValueError as error:
                raise ValueError(f'gait {index}: {error}') from error
        return commands

    def _publish(self) -> None:
        now = self.get_clock().now().nanoseconds * 1e-9
        if self._began is None or now < self._began:  # the simulator was restarted
            self._began = now
        self._publisher.publish(
            Float64MultiArray(data=self._commands[gait_at(now - self._began, self._durations, self._repeat)]))


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    run_node(GaitNode, lambda node: None, rclpy.spin_until_future_complete, args)
