"""The part of the command `ros2` that the tutorial uses, for environments without it: the wheels have none.

    python ros2_command.py run PACKAGE EXECUTABLE ...
    python ros2_command.py pkg prefix --share PACKAGE
    python ros2_command.py topic pub --once TOPIC TYPE VALUES
    python ros2_command.py topic echo TOPIC --field FIELD
    python ros2_command.py service call SERVICE TYPE VALUES
    python ros2_command.py param set NODE NAME VALUE
    python ros2_command.py bag record --include-unpublished-topics --storage mcap --output DIRECTORY --topics ...
"""

import importlib
import operator
import os
import signal
import sys
import threading
import time
from pathlib import Path

import rclpy
import yaml
from ament_index_python.packages import get_package_prefix, get_package_share_directory
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

LIMIT = 240.0  # s: nothing takes so long, and a test waits longer
DEPTH = 100_000  # messages of each topic: none is lost while this process stands still
PATIENCE = 5.0  # s, then a service is called again


def run(package, executable, *arguments):
    path = Path(get_package_prefix(package), 'lib', package, executable)
    os.execv(path, [str(path), *arguments])


def prefix(package):
    print(get_package_share_directory(package))


def publish_once(node, topic, kind, values='{}'):
    publisher = node.create_publisher(named(kind), topic, 10)
    wait(node, lambda: publisher.get_subscription_count() > 0, f'a subscriber of {topic}')
    publisher.publish(filled(named(kind)(), yaml.safe_load(values)))
    assert publisher.wait_for_all_acked(), topic
    print('publishing #1')


def echo(node, topic, field):
    def show(message):
        shown = operator.attrgetter(field)(message)
        print(*(f'{name}: {getattr(shown, name)}' for name in shown.get_fields_and_field_types()), '---', sep='\n')

    subscribe(node, [topic], lambda _, kind: (named(kind), show, {}))


def call(node, service, kind, values='{}'):
    print('response:', ask(node, named(kind), service, filled(named(kind).Request(), yaml.safe_load(values))))


def set_parameter(node, name, parameter, value):
    request = SetParameters.Request(
        parameters=[Parameter(parameter, value=yaml.safe_load(value)).to_parameter_msg()])
    (result,) = ask(node, SetParameters, f'{name}/set_parameters', request).results
    assert result.successful, result.reason
    print('Set parameter successful')


def record(node, output, topics):
    types = get_typestore(Stores.ROS2_JAZZY)
    with Writer(Path(output), version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP) as writer:
        def entry(topic, kind):
            connection = writer.add_connection(topic, kind, typestore=types)
            return named(kind), lambda data: writer.write(connection, time.time_ns(), data), {'raw': True}

        subscribe(node, topics, entry, unpublished=True)


def subscribe(node, topics, entry, unpublished=False):
    """Subscribe to each topic as soon as it has a publisher, as `entry` says of topic and type; until Ctrl-C.

    With `unpublished`, another subscriber is enough. What was received before Ctrl-C is taken.
    """
    ended, idle = threading.Event(), threading.Event()
    signal.signal(signal.SIGINT, lambda *_: ended.set())
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    awaited = set(topics)
    while not ended.is_set():
        for topic in sorted(awaited):
            publishers = node.get_publishers_info_by_topic(topic)
            if known := publishers or (node.get_subscriptions_info_by_topic(topic) if unpublished else []):
                kind, take, options = entry(topic, known[0].topic_type)

                def callback(message, take=take):
                    idle.clear()
                    take(message)

                reliability = publishers[0].qos_profile.reliability if publishers else ReliabilityPolicy.RELIABLE
                node.create_subscription(
                    kind, topic, callback, QoSProfile(depth=DEPTH, reliability=reliability), **options)
                awaited.remove(topic)
                print(f"Subscribed to topic '{topic}'", flush=True)
        executor.spin_once(timeout_sec=0.1)
    while not idle.is_set():
        idle.set()
        executor.spin_once(timeout_sec=0.0)


def ask(node, kind, name, request):
    client = node.create_client(kind, name)
    wait(node, client.service_is_ready, f'the service {name}')
    answers = []

    def answered():  # the middleware may lose the answer to a client that is new
        if time.monotonic() > began + PATIENCE * len(answers):
            answers.append(client.call_async(request))
        return any(answer.done() for answer in answers)

    began = time.monotonic()
    wait(node, answered, f'the answer of {name}')
    return next(answer.result() for answer in answers if answer.done())


def wait(node, condition, what):
    end = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < end, f'waited {LIMIT:g} s in vain for {what}'
        rclpy.spin_once(node, timeout_sec=0.05)


def named(kind):
    package, group, name = kind.split('/')
    return getattr(importlib.import_module(f'{package}.{group}'), name)


def filled(message, values):
    """Return a message with the values of a mapping."""
    for name, value in values.items():
        setattr(message, name, filled(getattr(message, name), value) if isinstance(value, dict) else value)
    return message


def main(arguments):
    match arguments:
        case ['run', *rest]:
            run(*rest)
        case ['pkg', 'prefix', '--share', package]:
            prefix(package)
        case _:
            rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
            act_with(rclpy.create_node(f'ros2_{os.getpid()}'), arguments)


def act_with(node, arguments):
    match arguments:
        case ['topic', 'pub', '--once', *rest]:
            publish_once(node, *rest)
        case ['topic', 'echo', topic, '--field', field]:
            echo(node, topic, field)
        case ['service', 'call', *rest]:
            call(node, *rest)
        case ['param', 'set', *rest]:
            set_parameter(node, *rest)
        case ['bag', 'record', '--include-unpublished-topics', '--storage', 'mcap', '--output', output,
              '--topics', *topics]:
            record(node, output, topics)
        case _:
            raise SystemExit(f'this command is not one of those in {__doc__}')


if __name__ == '__main__':
    main(sys.argv[1:])
