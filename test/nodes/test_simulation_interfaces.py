"""The standard services of simulators, where simulation_interfaces is installed, and what is said where it is not."""

import functools
import importlib.util
import math
import os

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3
from scipy.spatial.transform import Rotation

from evidence.harness.lockstep import LockstepRobot

INSTALLED = importlib.util.find_spec('simulation_interfaces') is not None
MISSING = 'the standard services of simulators are not offered, as simulation_interfaces is not installed'
SWIM = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]
NOT_INSTALLED = "raise ModuleNotFoundError('not installed', name='simulation_interfaces')\n"
NAME = '/standard/manta_sim'
FOLLOWS = 'the node follows /clock: pause, step and pace are those of the simulator that publishes it'
HALF = math.sqrt(0.5)
OF_A_LEADER = {25, 26, 31, 32}  # numbers of the standard: SIMULATION_STATE_SETTING and _PAUSE, STEP_SIMULATION_...
OF_EACH = {8, 10, 11, 12, 20, 22, 24}  # ENTITY_..., SIMULATION_RESET and _RESET_STATE, SIMULATION_STATE_GETTING

needs_the_package = pytest.mark.skipif(not INSTALLED, reason='simulation_interfaces is not installed')


def test_without_the_package_one_line_says_so_and_all_else_goes_on(launch, probe, tmp_path):
    package = tmp_path / 'simulation_interfaces'
    package.mkdir()
    (package / '__init__.py').write_text(NOT_INSTALLED, encoding='utf-8')
    paths = [str(tmp_path), *filter(None, [os.environ.get('PYTHONPATH')])]
    start = functools.partial(launch, environment={'PYTHONPATH': os.pathsep.join(paths)})
    robot = LockstepRobot(start, probe, 'bare', '-p start_paused:=true')
    robot.step()
    assert robot.pause(False).success and robot.trigger('reset').success
    assert robot.node.output.count(MISSING) == 1

    def services():
        return dict(probe.node.get_service_names_and_types_by_node('manta_sim', '/bare'))

    probe.until(lambda: ('manta_sim', '/bare') in probe.node.get_node_names_and_namespaces(), 'its name')
    probe.until(lambda: '/bare/manta_sim/reset' in services(), 'its services')
    assert not [name for name, types in services().items() if 'simulation_interfaces' in types[0]]


class Standard:
    """A simulator, and calls of its standard services."""

    def __init__(self, launch, probe, name, ros_arguments='', clock=None):
        self.robot = LockstepRobot(launch, probe, name, ros_arguments, clock)
        self._probe, self._node, self._clients = probe, f'/{name}/manta_sim', {}

    def _call(self, service, **request):
        """Call a service once. A new client calls it before with a request that changes nothing, as often as needed."""
        from simulation_interfaces import srv
        kind = getattr(srv, ''.join(word.capitalize() for word in service.split('_')))
        if service not in self._clients:
            self._clients[service] = self._probe.node.create_client(kind, f'{self._node}/{service}')
            self._probe.first_answer(self._clients[service], kind.Request(
                **{'steps': 0} if service == 'step_simulation' else {}))
        answer = self._clients[service].call_async(kind.Request(**request))
        self._probe.until(answer.done, f'the answer of {service}')
        return answer.result()

    def ask(self, service, **request):
        """Return the result code, the message, and the answer."""
        answer = self._call(service, **request)
        return answer.result.result, answer.result.error_message, answer

    def features(self):
        return self._call('get_simulator_features').features

    def set_state(self, state):
        from simulation_interfaces.msg import SimulationState
        return self.ask('set_simulation_state', state=SimulationState(state=state))[:2]

    def state(self):
        code, _, answer = self.ask('get_simulation_state')
        assert code == 1
        return answer.state.state

    def entities(self, **filters):
        from simulation_interfaces.msg import EntityFilters
        code, message, answer = self.ask('get_entities', filters=EntityFilters(**filters))
        return (code, message) if message else list(answer.entities)

    def entity_state(self):
        code, _, answer = self.ask('get_entity_state', entity=NAME)
        assert code == 1
        return answer.state


@pytest.fixture(scope='module')
def standard(module_launch, probe):
    pytest.importorskip('simulation_interfaces')
    return Standard(module_launch, probe, 'standard', '-p start_paused:=true -r /diagnostics:=/standard/diagnostics')


@pytest.fixture
def held(standard):
    """The paused simulator, whose robot is at rest at the origin."""
    assert standard.robot.pause().success and standard.robot.trigger('reset').success
    return standard


def vectors(message, first, second):
    return np.array([[getattr(getattr(message, part), axis) for axis in 'xyz'] for part in (first, second)])


def test_it_announces_what_is_there(held):
    features = held.features()
    assert set(features.features) == OF_EACH | OF_A_LEADER
    assert len(features.features) == len(set(features.features)) and not features.spawn_formats
    assert MISSING not in held.robot.node.output


def test_playing_and_paused_are_those_of_the_service_pause(held):
    assert held.state() == 2
    assert held.set_state(1)[0] == 1 and held.state() == 1
    assert held.set_state(1)[0] == 101  # already
    assert held.robot.pause().success and held.state() == 2
    assert held.set_state(2)[0] == 101
    assert held.robot.pause(False).success and held.set_state(2)[0] == 1
    assert held.robot.trigger('step').success


@pytest.mark.parametrize('state', [0, 3, 4, 5, 200])
def test_no_other_state_can_be_set(held, state):
    code, message = held.set_state(state)
    assert code == 0 and message.startswith(f'state is {state}, but must be 1 (playing) or 2 (paused)')
    assert held.state() == 2


def test_steps_are_those_of_the_service_step(held):
    held.robot.command(SWIM)
    began = held.robot.step()
    code, message, _ = held.ask('step_simulation', steps=7)
    assert code == 1 and message == f'stepped to {(began + 70_000_000) * 1e-9:.9g} s of simulated time'
    assert held.robot.step() == began + 80_000_000
    code, message, _ = held.ask('step_simulation', steps=0)
    assert (code, message) == (4, 'steps is 0, but must be at least 1')


def test_steps_are_refused_while_time_runs(held):
    assert held.robot.pause(False).success
    code, message, _ = held.ask('step_simulation')
    assert code == 4 and message.startswith('not paused: simulated time is running')


def test_a_reset_of_the_state_is_the_service_reset_and_time_is_never_reset(held):
    held.robot.command(SWIM)
    assert held.ask('step_simulation', steps=50)[0] == 1
    before = held.entity_state()
    assert before.pose.position.z < -0.01
    for scope in (0, 1, 3, 4, 6, 255):
        code, message, _ = held.ask('reset_simulation', scope=scope)
        assert code == 0 and message.startswith(f'scope is {scope}, but must be 2 (state): time never runs backward')
    assert held.entity_state() == before
    assert held.ask('reset_simulation', scope=2)[0] == 1
    after = held.entity_state()
    assert after.header == before.header and after.pose.position.z == 0.0


def test_the_robot_is_the_only_entity_and_its_name_that_of_the_node(held):
    from simulation_interfaces.msg import Bounds, EntityCategory, TagsFilter
    robot, human = EntityCategory(category=1), EntityCategory(category=2)

    def sphere(x, radius):
        return Bounds(type=3, points=[Vector3(x=x), Vector3(x=radius)])

    assert held.entities() == held.entities(filter='standard') == held.entities(categories=[human, robot]) == [NAME]
    assert held.entities(bounds=sphere(3.0, 3.1)) == [NAME]
    assert held.entities(filter='other') == held.entities(categories=[human]) == []
    assert held.entities(bounds=sphere(3.0, 2.9)) == []
    assert held.entities(filter='(a+)+')[0] == 0
    assert held.entities(bounds=sphere(3.0, -1.0))[0] == 4
    assert held.entities(bounds=Bounds(type=1))[0] == held.entities(tags=TagsFilter(tags=['wet']))[0] == 0
    code, _, answer = held.ask('get_entity_info', entity=NAME)
    assert code == 1 and answer.info.category == robot and answer.info.description


def test_another_entity_is_not_found(held):
    for service in ('get_entity_info', 'get_entity_state', 'set_entity_state'):
        code, message, _ = held.ask(service, entity='manta_2')
        assert (code, message) == (2, f"entity is 'manta_2', but must be '{NAME}', the only one")


def test_the_state_is_that_of_the_odometry_with_the_twist_in_the_world(held):
    held.robot.command([0.5, 0.2, 0.8, 0.8, 0.6, -0.3])
    assert held.ask('step_simulation', steps=100)[0] == 1
    stamp = held.robot.step()
    odometry, state = held.robot.odometry[-1], held.entity_state()
    assert state.header == odometry.header and state.pose == odometry.pose.pose
    assert stamp == state.header.stamp.sec * 1_000_000_000 + state.header.stamp.nanosec
    turned = odometry.pose.pose.orientation
    attitude = Rotation.from_quat([turned.x, turned.y, turned.z, turned.w])
    np.testing.assert_allclose(
        vectors(state.twist, 'linear', 'angular'),
        attitude.apply(vectors(odometry.twist.twist, 'linear', 'angular')), rtol=0.0, atol=1e-12)
    assert np.all(vectors(state.acceleration, 'linear', 'angular') != 0.0)


def wanted(x=1.0, frame='', turned=(0.0, 0.0, HALF, HALF), speed=0.0):
    from simulation_interfaces.msg import EntityState
    state = EntityState()
    state.header.frame_id, state.pose.position.x, state.twist.linear.x = frame, x, speed
    to = state.pose.orientation
    to.x, to.y, to.z, to.w = turned
    return state


def set_to(standard, state, **flags):
    from simulation_interfaces import srv
    known = srv.SetEntityState.Request.get_fields_and_field_types()
    return standard.ask(
        'set_entity_state', entity=NAME, state=state, **{flag: on for flag, on in flags.items() if flag in known})[:2]


@pytest.mark.parametrize('frame', ['', 'odom'])
def test_it_is_put_at_a_pose_with_a_twist_in_the_world(held, frame):
    assert set_to(held, wanted(frame=frame, speed=0.5), set_pose=True, set_twist=True) == (1, '')
    state = held.entity_state()
    assert state.pose.position.x == 1.0 and state.pose.orientation.z == pytest.approx(HALF)
    assert state.twist.linear.x == pytest.approx(0.5) and state.twist.linear.y == pytest.approx(0.0, abs=1e-12)
    held.robot.probe.until(lambda: held.robot.odometry[-1].pose.pose.position.x == 1.0, 'the pose on its topic')
    assert held.robot.odometry[-1].twist.twist.linear.y == pytest.approx(-0.5)
    held.robot.step()
    assert held.robot.odometry[-1].pose.pose.position.x > 1.003


def test_what_is_not_to_be_set_stays(held):
    from simulation_interfaces import srv
    if 'set_pose' not in srv.SetEntityState.Request.get_fields_and_field_types():
        pytest.skip('this simulation_interfaces has no such flags: they came with 2.1')
    assert set_to(held, wanted(speed=0.5), set_pose=True) == (1, '')
    state = held.entity_state()
    assert state.pose.position.x == 1.0 and state.twist.linear.x == 0.0
    assert set_to(held, wanted(x=math.nan, speed=0.5), set_twist=True) == (1, '')
    moving = held.entity_state()
    assert moving.pose == state.pose and moving.twist.linear.x == pytest.approx(0.5)
    code, message = set_to(held, wanted(x=9.0), set_acceleration=True)
    assert code == 1 and message.startswith('nothing changes') and held.entity_state() == moving


@pytest.mark.parametrize(('values', 'code', 'words'), [
    ({'turned': (0.0, 0.0, 0.0, 3.0)}, 'INVALID_POSE', 'pose.orientation has norm 3, but must be a unit quaternion'),
    ({'x': 1e7}, 'INVALID_POSE', 'pose.position.x is 10000000.0, but must be from'),
    ({'frame': 'map'}, 'INVALID_POSE', "header.frame_id is 'map', but must be 'odom'"),
    ({'speed': math.inf}, 'RESULT_OPERATION_FAILED', 'twist.linear.x is inf, but must be from -100 to 100 m/s'),
])
def test_an_invalid_state_is_refused_and_nothing_changes(held, values, code, words):
    from simulation_interfaces import srv
    code = getattr(srv.SetEntityState.Response, code, 4)  # INVALID_POSE came with 1.0.1
    before = held.entity_state()
    refused, message = set_to(held, wanted(**values), set_pose=True, set_twist=True)
    assert refused == code and message.startswith(words)
    assert held.entity_state() == before


def test_refused_calls_are_counted_with_those_of_the_other_services(held):
    heard = held.robot.probe.record(DiagnosticArray, '/standard/diagnostics')

    def counted():
        return int({value.key: value.value for value in heard[-1].status[1].values}['service calls refused'])

    held.robot.probe.until(lambda: len(heard) > 1, 'diagnostics')
    before = counted()
    assert held.ask('reset_simulation', scope=1)[0] == 0
    assert held.ask('get_entity_info', entity='none')[0] == 2
    held.robot.probe.until(lambda: counted() >= before + 2, 'the counts')


@needs_the_package
def test_a_follower_leaves_state_and_steps_to_its_leader(launch, probe):
    leader = LockstepRobot(launch, probe, 'ahead', '-p start_paused:=true')
    follower = Standard(
        launch, probe, 'behind', '-p publish_clock:=false -p use_sim_time:=true', clock='/ahead/clock')
    leader.step()
    features = follower.features()
    assert set(features.features) == OF_EACH and FOLLOWS in features.custom_info
    for answer in (follower.set_state(1), follower.set_state(2), follower.ask('step_simulation')[:2]):
        assert answer == (0, FOLLOWS)
    probe.until(lambda: follower.state() == 2, 'that it stands still')
    assert leader.pause(False).success
    probe.until(lambda: follower.state() == 1, 'that it moves')
    assert follower.ask('reset_simulation', scope=2)[0] == 1
