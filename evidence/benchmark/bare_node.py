"""The least node in Python, to compare with: one timer, and one Odometry at 100 Hz."""

from __future__ import annotations

import contextlib
import sys

import rclpy
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.task import Future

RATE = 100.0  # Hz
TOPIC = 'bare_odom'
EXECUTORS = {'single-threaded': SingleThreadedExecutor, 'events': EventsExecutor}


def main(executor: str) -> None:
    """Publish until the process is ended."""
    rclpy.init()
    node = rclpy.create_node('bare_node')
    publisher = node.create_publisher(Odometry, TOPIC, 10)
    message = Odometry(child_frame_id='bare_base_link')
    message.header.frame_id = 'odom'

    def publish() -> None:
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)

    node.create_timer(1.0 / RATE, publish)
    executing = EXECUTORS[executor]()
    executing.add_node(node)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        while rclpy.ok():  # without an end, the executor of events never sleeps where waiting is against the wall clock
            executing.spin_until_future_complete(Future(), timeout_sec=1.0)


if __name__ == '__main__':
    main(sys.argv[1])
