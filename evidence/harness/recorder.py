"""A recorder in its own process, as `ros2 bag record` is one: it writes topics of any type into an MCAP file.

    python recorder.py FILE TOPIC ... [--ros-args ...]

With the parameter `use_sim_time` it subscribes after it has heard a clock above 0, as `ros2 bag record` does. The
package `mcap` writes the serialized messages with their definitions. For each message that was written, one line
with its topic and its time of sending [ns, system clock] is printed. SIGINT or SIGTERM ends the recording.
"""

import functools
import re
import signal
import sys
import threading
import time
from pathlib import Path

import rclpy
from ament_index_python.packages import get_package_share_directory
from mcap.well_known import Profile, SchemaEncoding
from mcap.writer import CompressionType, Writer
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from manta_sim_ros.nodes.qos import message_class

DEPTH = 100_000


def definition(name):
    """Return the definition of a type and, below it, of all types in it, in the order of rosbag2."""
    definitions = {}

    def collect(name):
        package, *_, kind = name.split('/')
        definitions[f'{package}/{kind}'] = Path(get_package_share_directory(package), 'msg', f'{kind}.msg').read_text()
        for field in message_class(name).get_fields_and_field_types().values():
            for part in re.findall(r'\w+/\w+', field):
                if part not in definitions:
                    collect(part)

    collect(name)
    (_, first), *others = definitions.items()
    return first + ''.join(f'\n{"=" * 80}\nMSG: {part}\n{text}' for part, text in others)


def record(node, writer, topics, ended):
    """Subscribe to each topic as soon as it has a publisher, and write what comes until `ended` is set."""
    def write(channel, topic, message, info):
        sent = info['source_timestamp']
        writer.add_message(channel, log_time=time.time_ns(), publish_time=sent, data=message)
        print(topic, sent, flush=True)

    simulated = node.get_parameter('use_sim_time').value
    awaited = set(topics)
    while not ended.is_set():
        for topic in sorted(awaited if not simulated or node.get_clock().now().nanoseconds > 0 else ()):
            if publishers := node.get_publishers_info_by_topic(topic):
                name, offered = publishers[0].topic_type, publishers[0].qos_profile
                schema = writer.register_schema(name, SchemaEncoding.ROS2, definition(name).encode())
                channel = writer.register_channel(topic, 'cdr', schema)
                node.create_subscription(
                    message_class(name), topic, functools.partial(write, channel, topic),
                    QoSProfile(depth=DEPTH, reliability=offered.reliability, durability=offered.durability),
                    raw=True)
                awaited.remove(topic)
        rclpy.spin_once(node, timeout_sec=0.1)


def main():
    path, *topics = remove_ros_args(sys.argv)[1:]
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())  # an exception could cut a message off
    with Path(path).open('wb') as file:
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile=Profile.ROS2)
        record(rclpy.create_node('recorder'), writer, topics, ended)
        writer.finish()
        rclpy.shutdown()


if __name__ == '__main__':
    main()
