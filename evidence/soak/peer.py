"""Another process on the topics: publishers of commands, or subscribers of `odom`, which may be slow.

    python -m evidence.soak.peer command COUNT RATE
    python -m evidence.soak.peer listen COUNT DELAY

SIGTERM ends it; then it prints what it did as JSON. Before, it says when each subscriber has heard a message.
"""

from __future__ import annotations

import functools
import json
import signal
import sys
import threading
import time
from typing import Any

import rclpy
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray

PERIOD = 10_000_000  # ns between two outputs


def command(node: Node, count: int, rate: float, ended: threading.Event) -> dict[str, Any]:
    """Publish valid gaits at a rate [Hz] with each of `count` publishers."""
    publishers = [node.create_publisher(Float64MultiArray, '/loaded/fin_command', 10) for _ in range(count)]
    sent, began = 0, time.monotonic()
    while not ended.is_set():
        gait = [0.6 + 0.1 * (sent % 2), 0.6, 0.6, 0.6, 0.7, 0.7]
        for publisher in publishers:
            publisher.publish(Float64MultiArray(data=gait))
        sent += 1
        time.sleep(max(0.0, began + sent / rate - time.monotonic()))
    return {'rate': count * sent / (time.monotonic() - began)}


def listen(node: Node, count: int, delay: float, ended: threading.Event) -> dict[str, Any]:
    """Subscribe `count` times, and wait for `delay` [s] with each message."""
    last: dict[int, int] = {}
    found = {'received': 0, 'lost': 0, 'backward': 0}

    def take(number: int, message: Odometry) -> None:
        if number not in last and len(last) + 1 == count:
            print('all heard', flush=True)
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        passed = stamp - last.get(number, stamp - PERIOD)
        last[number] = stamp
        found['received'] += 1
        found['lost'] += max(0, passed // PERIOD - 1)
        found['backward'] += passed <= 0
        time.sleep(delay)

    subscriptions = [
        node.create_subscription(Odometry, '/loaded/odom', functools.partial(take, number), 10)
        for number in range(count)]
    while not ended.is_set():
        rclpy.spin_once(node, timeout_sec=0.1)
    return {**found, 'subscribers': len(subscriptions), 'heard': len(last)}


def main() -> None:
    """Run until SIGTERM."""
    kind, count, number = sys.argv[1:]
    ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    run = {'command': command, 'listen': listen}[kind]
    print(json.dumps(run(rclpy.create_node(f'{kind}_peer'), int(count), float(number), ended)), flush=True)


if __name__ == '__main__':
    main()
