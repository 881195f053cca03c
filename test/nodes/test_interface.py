"""The topics, services and parameters of the docs, which are those of the code, are those of the running node."""

import importlib.util
import re

import pytest
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python
from rosgraph_msgs.msg import Clock

from manta_sim_ros.nodes.interface import SERVICES, TOPICS
from manta_sim_ros.nodes.settings import Settings

OF_ANY_NODE = {'use_sim_time', 'start_type_description_service'}


@pytest.fixture(scope='module')
def ask(module_launch, probe):
    module_launch('sim_node', '-p publish_ned:=true')
    with probe.record(Clock, '/clock') as clock:
        probe.until(lambda: clock, 'the clock')
    return lambda service_type, name, **request: probe.call(service_type, f'/manta_sim/{name}', **request)


@pytest.fixture(scope='module')
def live_parameters(ask):
    """Default, bounds, whether live, and description, of each parameter by its name."""
    names = [name for name in ask(ListParameters, 'list_parameters').result.names
             if name not in OF_ANY_NODE and not name.startswith('qos_overrides.')]
    values = ask(GetParameters, 'get_parameters', names=names).values
    descriptors = ask(DescribeParameters, 'describe_parameters', names=names).descriptors
    return {name: (default(value), bounds(descriptor), not descriptor.read_only, descriptor.description)
            for name, value, descriptor in zip(names, values, descriptors)}


def default(value):
    value = parameter_value_to_python(value)
    return value if isinstance(value, bool | int | float | str) else tuple(value)


def bounds(descriptor):
    ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
    each = re.search(r'from (\S+) to (\S+)', descriptor.additional_constraints)  # of a vector's components
    if each:
        return float(each[1]), float(each[2])
    return (ranges[0].from_value, ranges[0].to_value) if ranges else None


def test_the_topics_are_those_of_the_running_node(ask, probe):
    live = {
        name if name in ('/tf', '/tf_static', '/clock', '/diagnostics') else name.removeprefix('/'): (kind, direction)
        for direction, topics in zip(('in', 'out'), probe.topics_of('manta_sim')) for name, kind in topics.items()
    }
    listed = {name: (topic.type, topic.direction) for name, topic in TOPICS.items()}
    if importlib.util.find_spec('tf2_msgs') is None:
        for topic in ('/tf', '/tf_static'):
            assert listed.pop(topic) == ('tf2_msgs/msg/TFMessage', 'out')
    assert listed == live
    assert all(topic.meaning for topic in TOPICS.values())


def test_the_services_are_those_of_the_running_node(ask, probe):
    def live():
        found = probe.node.get_service_names_and_types_by_node('manta_sim', '/')
        return {name.replace('/manta_sim/', '~/'): types[0] for name, types in found
                if types[0].partition('/')[0] in ('std_srvs', 'simulation_interfaces')}

    probe.until(lambda: ('manta_sim', '/') in probe.node.get_node_names_and_namespaces(), 'the node')
    listed = {name: service.type for name, service in SERVICES.items()}
    if importlib.util.find_spec('simulation_interfaces') is None:
        optional = {name for name, kind in listed.items() if kind.startswith('simulation_interfaces/')}
        assert len(optional) == 9 and all('where simulation_interfaces is installed' in SERVICES[name].meaning
                                          for name in optional)
        listed = {name: kind for name, kind in listed.items() if name not in optional}
    probe.until(lambda: listed.keys() <= live().keys(), 'the services')
    assert listed == live()
    assert all(service.meaning for service in SERVICES.values())


def test_the_parameters_are_those_of_the_running_node(live_parameters):
    settings = Settings().replace([('publish_ned', True)])
    assert live_parameters == {
        name: (
            settings.value(name), (about.low, about.high) if about.kind in (int, float, tuple) else None, about.live,
            f'{about.description}{about.unit and f" [{about.unit}]"} ({about.source})')
        for name, about in Settings.quantities().items()}
