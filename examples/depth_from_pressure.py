#!/usr/bin/env python3
"""Publish the height that follows from the pressure as `depth`, for filters, which take poses but no pressure.

    ros2 run manta_sim_ros sim_node
    python3 examples/depth_from_pressure.py --ros-args -p use_sim_time:=true

Only z of the pose is measured. All other variances are 1e6, so that nobody takes the zeros for measurements.
"""

import rclpy
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import FluidPressure

UNKNOWN = 1e6  # m^2, rad^2


class DepthFromPressure(Node):
    """Parameters as those of the simulator: surface_height, atmospheric, water_density, gravity, odom_frame."""

    def __init__(self):
        super().__init__('depth_from_pressure')
        for name, value in (('surface_height', 5.0), ('atmospheric', 101325.0), ('water_density', 1000.0),
                            ('gravity', 9.81), ('odom_frame', 'odom')):
            self.declare_parameter(name, value)
        self.depth = self.create_publisher(PoseWithCovarianceStamped, 'depth', 10)
        self.create_subscription(FluidPressure, 'pressure', self.convert, 10)

    def convert(self, pressure):
        surface, atmospheric, density, gravity, frame = (self.get_parameter(name).value for name in (
            'surface_height', 'atmospheric', 'water_density', 'gravity', 'odom_frame'))
        message = PoseWithCovarianceStamped()
        message.header.stamp, message.header.frame_id = pressure.header.stamp, frame
        weight = density * gravity  # Pa/m
        message.pose.pose.position.z = surface - (pressure.fluid_pressure - atmospheric) / weight
        message.pose.covariance[::7] = [UNKNOWN, UNKNOWN, pressure.variance / weight**2, UNKNOWN, UNKNOWN, UNKNOWN]
        self.depth.publish(message)


if __name__ == '__main__':
    rclpy.init()
    try:
        rclpy.spin(DepthFromPressure())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Exception:
        if rclpy.ok():  # else SIGTERM came at a moment for which rclpy raises another error
            raise
