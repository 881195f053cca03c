#!/usr/bin/env python3
"""Hold a heading: a controller that turns the robot with the difference of the phases of its fins.

    ros2 run manta_sim_ros sim_node
    python3 examples/turn_with_feedback.py --ros-args -p use_sim_time:=true -p heading:=1.0

It works with the same gains in fresh water, `sim_node --ros-args --params-file config/freshwater.yaml`: from rest it
turns by 1 rad, within 0.1 rad, in 4 s instead of 5 s. With half of RATE_GAIN it would overshoot by 0.3 rad there.
"""

import math

import rclpy
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

AMPLITUDE, FREQUENCY, PHASE = math.radians(40.0), 0.6, math.radians(40.0)  # rad, Hz, rad
LARGEST_DIFFERENCE = math.radians(40.0)  # of the two phases [rad]
HEADING_GAIN, RATE_GAIN = 1.0, 2.0  # rad of phase per rad, and per rad/s


class HeadingController(Node):
    """Publish gaits that turn the robot to the parameter `heading` [rad], positive to the left."""

    def __init__(self):
        super().__init__('heading_controller')
        self.heading = self.declare_parameter('heading', 1.0).value
        self.odometry = None
        self.commands = self.create_publisher(Float64MultiArray, 'fin_command', 1)
        self.create_subscription(Odometry, 'odom', self.receive, 1)
        self.create_timer(0.1, self.control)

    def receive(self, odometry):
        self.odometry = odometry

    def control(self):
        if self.odometry is None:
            return
        q = self.odometry.pose.pose.orientation
        heading = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
        error = math.remainder(self.heading - heading, 2.0 * math.pi)
        difference = HEADING_GAIN * error - RATE_GAIN * self.odometry.twist.twist.angular.z
        difference = max(-LARGEST_DIFFERENCE, min(difference, LARGEST_DIFFERENCE))
        # The robot turns to the side of the weaker fin: less phase on the left turns it to the left.
        self.commands.publish(Float64MultiArray(data=[
            AMPLITUDE, AMPLITUDE, FREQUENCY, FREQUENCY, PHASE - difference / 2.0, PHASE + difference / 2.0]))
        self.get_logger().info(f'heading {heading:.2f} rad', throttle_duration_sec=1.0)


if __name__ == '__main__':
    rclpy.init()
    try:
        rclpy.spin(HeadingController())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Exception:
        if rclpy.ok():  # else SIGTERM came at a moment for which rclpy raises another error
            raise
