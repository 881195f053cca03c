#!/usr/bin/env python3
"""Swim with a central pattern generator: four coupled oscillators, one for each rod, command the rods.

    ros2 run manta_sim_ros sim_node --ros-args --params-file config/freshwater.yaml
    python3 examples/pattern_generator.py --ros-args -p use_sim_time:=true -p frequency:=0.6

Each oscillator is pulled towards its phase behind the others, and its amplitude towards the parameter, so that the gait
changes smoothly whenever a parameter is set. Front rods lead by `lead`, as in `fin_command`.
"""

import math

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState

RODS = ['left_front_rod', 'left_rear_rod', 'right_front_rod', 'right_rear_rod']
PERIOD, LONGEST, COUPLING = 0.02, 0.05, 4.0  # s, s, 1/s


class PatternGenerator(Node):
    """Publish rod angles; parameters: amplitude [rad], frequency [Hz], lead [rad]."""

    def __init__(self):
        super().__init__('pattern_generator')
        for name, value in (('amplitude', 0.6), ('frequency', 0.6), ('lead', 0.7)):
            self.declare_parameter(name, value)
        self.phases, self.amplitude = [0.0, 1.0, 2.0, 3.0], 0.0  # they find together from any phases
        self.before = None
        self.rods = self.create_publisher(JointState, 'rod_command', 1)
        self.create_timer(PERIOD, self.step)

    def step(self):
        amplitude, frequency, lead = (self.get_parameter(name).value for name in ('amplitude', 'frequency', 'lead'))
        now = 1e-9 * self.get_clock().now().nanoseconds
        period = 0.0 if self.before is None else min(max(0.0, now - self.before), LONGEST)  # callbacks may be late
        self.before = now
        ahead = [lead, 0.0, lead, 0.0]
        aligned = [phase - more for phase, more in zip(self.phases, ahead, strict=True)]
        pulls = [sum(math.sin(other - own) for other in aligned) for own in aligned]
        self.phases = [phase + period * (2.0 * math.pi * frequency + COUPLING * pull)
                       for phase, pull in zip(self.phases, pulls, strict=True)]
        self.amplitude += period * COUPLING * (amplitude - self.amplitude)
        self.rods.publish(JointState(name=RODS, position=[self.amplitude * math.sin(phase) for phase in self.phases]))


if __name__ == '__main__':
    rclpy.init()
    try:
        rclpy.spin(PatternGenerator())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Exception:
        if rclpy.ok():  # else SIGTERM came at a moment for which rclpy raises another error
            raise
