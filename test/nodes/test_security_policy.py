"""The SROS 2 policy allows each node what it does in the running graph, and nothing else."""

import itertools
from pathlib import Path
from xml.etree import ElementTree

import pytest

from manta_sim_ros.nodes.interface import SERVICES, TOPICS

POLICY = Path(__file__).parents[2] / 'config' / 'sros2' / 'policy.xml'
RIGHTS = {'publish': 'publisher', 'subscribe': 'subscriber', 'reply': 'service', 'request': 'client'}
NODES = {
    'manta_sim': 'sim_node', 'manta_gait': 'gait_node', 'manta_monitor': 'monitor_node',
    'manta_path_follower': 'path_follower', 'manta_track': 'track_node'}


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


@pytest.fixture(scope='module')
def graph(module_launch, probe):
    """What each node does, as the profiles; the simulator both as the one that publishes the clock and as another."""
    module_launch('sim_node')
    module_launch('sim_node', '-r __ns:=/other -p publish_clock:=false -p use_sim_time:=true')
    module_launch('gait_node', '-p use_sim_time:=true')
    module_launch('monitor_node', '-p use_sim_time:=true')
    module_launch('path_follower', '-p use_sim_time:=true')
    module_launch('track_node', '-p use_sim_time:=true -p lockstep:=true')

    def done(node, namespace='/'):
        return {
            (right, name) for right, entity in RIGHTS.items()
            for name, _ in getattr(probe.node, f'get_{entity}_names_and_types_by_node')(node, namespace)}

    def snapshot():
        names = set(probe.node.get_node_names_and_namespaces())
        if not {(node, '/') for node in NODES} | {('manta_sim', '/other')} <= names:
            return None
        found = {node: done(node) for node in NODES}
        found['manta_sim'] |= {(right, name.removeprefix('/other')) for right, name in done('manta_sim', '/other')}
        return found

    seen = []

    def settled():
        probe.listen(1.0)
        seen.append(snapshot())
        complete = seen[-1] and all(('reply', f'/{node}/set_parameters_atomically') in seen[-1][node] for node in NODES)
        return bool(complete) and len(seen) > 2 and seen[-3] == seen[-2] == seen[-1]

    probe.until(settled, 'a graph that does not change')
    return seen[-1]


@pytest.mark.parametrize('node', NODES)
def test_a_node_is_allowed_what_it_does_and_nothing_else(profiles, graph, node):
    done = set(graph[node])
    if node == 'manta_sim':  # also what it does where tf2_msgs is installed
        rights = {'in': 'subscribe', 'out': 'publish'}
        done |= {(rights[topic.direction], resolved(name, node)) for name, topic in TOPICS.items()}
        done |= {('reply', resolved(name, node)) for name in SERVICES}
    assert profiles[node] == done


def test_the_policy_has_one_profile_for_each_node_and_no_wildcard(profiles):
    assert set(profiles) == set(NODES)
    for _, name in itertools.chain.from_iterable(profiles.values()):
        assert not set(name) & set('*?[]')
