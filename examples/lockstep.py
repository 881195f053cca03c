#!/usr/bin/env python3
"""Advance the simulator in lockstep: command, step, read. The result does not depend on the speed of the machine.

    ros2 run manta_sim_ros sim_node --ros-args -p start_paused:=true -p step_duration:=0.5
    python3 examples/lockstep.py
"""

import math

import rclpy
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.time import Time
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

AMPLITUDES = [math.radians(amplitude) for amplitude in (5, 10, 15, 20, 25, 30, 35, 40)]  # rad, one for each step
FREQUENCY, PHASE = 0.6, math.radians(40.0)  # Hz, rad
STEP = 500_000_000  # step_duration of the simulator [ns]


def main():
    """Increase the amplitude in each step, and print where the robot is after it."""
    node = Node('lockstep_example')
    heard = []
    node.create_subscription(Odometry, 'odom', heard.append, 1000)  # the queue is longer than the outputs of a step
    commands = node.create_publisher(Float64MultiArray, 'fin_command', 1)
    reset, step = (node.create_client(Trigger, f'manta_sim/{name}') for name in ('reset', 'step'))

    def call(client, patience=None):
        if not client.wait_for_service(timeout_sec=10.0):
            raise RuntimeError(f'no service {client.srv_name} within 10 s: is the simulator running?')
        answer = client.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(node, answer, timeout_sec=patience)
        if answer.done() and not answer.result().success:
            raise RuntimeError(answer.result().message)
        return answer.done()

    def stamp():
        return Time.from_msg(heard[-1].header.stamp).nanoseconds

    while not call(reset, patience=5.0):  # publishes the first state; the answer to a new client may be lost
        pass
    while not heard or commands.get_subscription_count() == 0:
        rclpy.spin_once(node)
    for amplitude in AMPLITUDES:
        end = stamp() + STEP
        commands.publish(Float64MultiArray(data=[amplitude, amplitude, FREQUENCY, FREQUENCY, PHASE, PHASE]))
        commands.wait_for_all_acked()  # the command has arrived before the step begins
        call(step)
        while stamp() < end:
            rclpy.spin_once(node)
        print(f'{end * 1e-9:.1f} s: x = {heard[-1].pose.pose.position.x:.4f} m')


if __name__ == '__main__':
    rclpy.init()
    main()
    rclpy.shutdown()
