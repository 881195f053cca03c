"""The SROS 2 policy allows each node what it does in the running graph, and nothing else."""

import contextlib
import itertools
from pathlib import Path
from xml.etree import ElementTree

import pytest

from manta_sim_ros.nodes.interface import SERVICES, TOPICS

POLICY = Path(__file__).parents[2] / 'config' / 'sros2' / 'policy.xml'
RIGHTS = {'publish': 'publisher', 'subscribe': 'subscriber', 'reply': 'service', 'request': 'client'}
NODES = {
    'manta_sim': 'sim_node', 'manta_gait': 'gait_node', 'manta_monitor': 'monitor_node',
    'manta_path_follower': 'path_follower', 'manta_mpc_follower': 'mpc_follower', 'manta_teleop': 'teleop',
    'manta_track': 'track_node'}


def resolved(name, node, namespace='/'):
    """Return the full name of a topic or a service."""
    if name.startswith('/'):
        return name
    return namespace.rstrip('/') + '/' + name.replace('~', node)


@pytest.fixture(scope='module')
def profiles():
    """What the policy allows each node, as a set of pairs (right, full name); each node has an enclave of its name."""
    policy = ElementTree.parse(POLICY).getroot()
    assert policy.tag == 'policy' and policy.get('version') == '0.2.0'
    found = {}
    for enclave in policy.iterfind('enclaves/enclave'):
        (profile,) = enclave.iterfind('profiles/profile')
        node = profile.get('node')
        assert enclave.get('path') == f'/{node}' and profile.get('ns') == '/'
        granted = [
            (right, resolved(each.text, node)) for section in profile for right, value in section.items()
            for each in section if value == 'ALLOW']
        assert len(granted) == len(set(granted)) == len(profile.findall('*/*'))
        found[node] = set(granted)
    return found


def not_in_the_graph(node):
    """Return what a node does where tf2_msgs and simulation_interfaces are installed, and teleop in a terminal."""
    if node == 'manta_teleop':
        return {('subscribe', topic) for topic in ('/odom', '/joint_states', '/diagnostics')}
    if node != 'manta_sim':
        return set()
    rights = {'in': 'subscribe', 'out': 'publish'}
    return {*((rights[topic.direction], resolved(name, node)) for name, topic in TOPICS.items()),
            *(('reply', resolved(name, node)) for name in SERVICES)}


@pytest.fixture(scope='module')
def graph(module_launch, probe, profiles):
    """What each node does, as the profiles; the simulator both as the one that publishes the clock and as another."""
    simulators = [
        module_launch('sim_node'),
        module_launch('sim_node', '-r __ns:=/other -p publish_clock:=false -p use_sim_time:=true')]
    module_launch('gait_node', '-p use_sim_time:=true')
    for follower in ('path_follower', 'mpc_follower', 'teleop'):
        module_launch(follower, '-p use_sim_time:=true')
    module_launch('track_node', '-p use_sim_time:=true -p lockstep:=true')
    module_launch('monitor_node', '-p use_sim_time:=true').wait_for_output(' time ')  # it hears the first one
    for simulator in simulators:
        simulator.wait_for_output('ready')

    def done(node, namespace='/'):
        return {
            (right, name) for right, entity in RIGHTS.items()
            for name, _ in getattr(probe.node, f'get_{entity}_names_and_types_by_node')(node, namespace)}

    def snapshot():
        names = set(probe.node.get_node_names_and_namespaces())
        if not {(node, '/') for node in NODES} | {('manta_sim', '/other')} <= names:
            return {}
        found = {node: done(node) for node in NODES}
        found['manta_sim'] |= {(right, name.removeprefix('/other')) for right, name in done('manta_sim', '/other')}
        return found

    def complete():
        found = snapshot()
        return found and all(profiles[node] <= found[node] | not_in_the_graph(node) for node in NODES)

    with contextlib.suppress(AssertionError):  # what is missing then is told by the tests
        probe.until(complete, 'a graph with all that is allowed')
    return snapshot()


@pytest.mark.parametrize('node', NODES)
def test_a_node_is_allowed_what_it_does_and_nothing_else(profiles, graph, node):
    assert profiles[node] == graph[node] | not_in_the_graph(node)


def test_the_policy_has_one_profile_for_each_node_and_no_wildcard(profiles):
    assert set(profiles) == set(NODES)
    for _, name in itertools.chain.from_iterable(profiles.values()):
        assert not set(name) & set('*?[]')
