"""Diagnostics: what is wrong is said, at its level, in words with the numbers; of a real node, and case by case."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool

from evidence.harness.lockstep import LockstepRobot
from manta_sim_ros.dynamics import FinCommand, Simulator
from manta_sim_ros.nodes.diagnostics import Health, statuses
from manta_sim_ros.nodes.refusals import Refused

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
SWIM = [0.7, 0.7, 0.6, 0.6, 0.7, 0.7]
NONE = Refused(0, 0, '')
INPUTS = (
    'fin_command', 'rod_command', 'set_pose', 'initialpose', 'parameters', 'service calls', 'current', 'body_wrench')
WELL = Health(
    time=12.5, paused=False, follows=False, clock_trouble='', wanted_factor=1.0, reached_factor=1.0, computing=2.7e-5,
    commanding_topic='fin_command', held=NONE, command_age=0.1, timed_out=False, abandoned=False,
    refused=dict.fromkeys(INPUTS, NONE), current=np.zeros(3),
    external_wrench=False, diverged_lately=False, finite=True, time_step=0.002, largest_step=0.0049,
    body_in_water=1.0, fins_in_water=1.0, power=6.5, speed=0.33, weight=196.2)


def refused(topic, total, lately=0, reason=''):
    """Return the change of a node that refused messages of one topic."""
    return {'refused': WELL.refused | {topic: Refused(total, lately, reason)}}


def by_matter(messages):
    return {status.name.partition(': ')[2]: status for status in messages}


def test_a_robot_that_is_well_is_ok_in_everything():
    said = statuses('/manta_sim', WELL)
    assert [status.name for status in said] == [
        '/manta_sim: pace', '/manta_sim: commands', '/manta_sim: disturbances', '/manta_sim: motion',
        '/manta_sim: time step', '/manta_sim: power', '/manta_sim: water']
    assert {status.level for status in said} == {OK}
    assert {status.hardware_id for status in said} == {'/manta_sim'}
    values = {value.key: value.value for status in said for value in status.values}
    assert values == {
        'simulated time [s]': '12.500', 'real-time factor': '1', 'real-time factor asked for': '1',
        'computing time of a step [us]': '27', 'age of the last fin_command [s]': '0.1', 'refused': '0',
        'rod_command refused': '0', 'rod_command held': '0', 'set_pose refused': '0', 'initialpose refused': '0',
        'parameters refused': '0', 'service calls refused': '0',
        'current [m/s]': '0 0 0', 'body_wrench acts': 'false', 'disturbances refused': '0',
        'finite': 'true', 'solver.time_step [s]': '0.002', 'largest stable [s]': '0.0049',
        'mean power of the rods [W]': '6.5', 'mean forward speed [m/s]': '0.33', 'cost of transport': '0.1',
        'body in the water': '100 %', 'fins in the water': '100 %'}


def test_what_is_not_known_is_a_dash():
    unknown = dataclasses.replace(
        WELL, paused=True, reached_factor=math.nan, computing=math.nan, command_age=math.nan, power=math.nan,
        speed=math.nan)
    values = {value.key: value.value for status in statuses('/manta_sim', unknown) for value in status.values}
    assert [key for key, value in values.items() if value == '-'] == [
        'real-time factor', 'computing time of a step [us]', 'age of the last fin_command [s]',
        'mean power of the rods [W]', 'mean forward speed [m/s]', 'cost of transport']


@pytest.mark.parametrize(('change', 'matter', 'level', 'words'), [
    ({'paused': True, 'reached_factor': math.nan}, 'pace', OK, 'paused'),
    ({'paused': True, 'follows': True}, 'pace', OK, 'simulated time stands still, as /clock does'),
    ({'reached_factor': math.nan}, 'pace', OK, 'simulated time runs'),
    ({'clock_trouble': 'nobody publishes'}, 'pace', WARN, 'nobody publishes'),
    ({'reached_factor': 0.42}, 'pace', WARN, 'cannot keep up: simulated time runs at 0.42 times real time'),
    ({'reached_factor': 0.96}, 'pace', OK, '0.96 times real time'),
    ({'wanted_factor': 0.0, 'reached_factor': 35.0}, 'pace', OK, '35 times real time'),
    ({'command_age': math.nan}, 'commands', OK, 'no fin_command yet'),
    ({'timed_out': True, 'command_age': 2.0}, 'commands', WARN, 'no fin_command for 2 s'),
    (refused('fin_command', 9, 3, 'left phase is nan'), 'commands', WARN,
     '3 fin_command refused just now: left phase is nan'),
    (refused('fin_command', 9), 'commands', OK, 'the last fin_command came 0.1 s ago'),
    (refused('set_pose', 2, 2, 'pose.orientation has norm 0'), 'commands', WARN,
     '2 set_pose refused just now: pose.orientation has norm 0'),
    (refused('initialpose', 1, 1, 'header'), 'commands', WARN, '1 initialpose refused just now: header'),
    (refused('parameters', 2, 1, 'fin.span is 0'), 'commands', WARN, '1 parameters refused just now: fin.span is 0'),
    (refused('service calls', 2, 1, 'not paused'), 'commands', WARN, '1 service calls refused just now: not paused'),
    (refused('rod_command', 2, 1, 'no name'), 'commands', WARN, '1 rod_command refused just now: no name'),
    ({'held': Refused(3, 2, 'too far')}, 'commands', WARN, '2 rod_command held just now: too far'),
    ({'commanding_topic': 'rod_command'}, 'commands', OK, 'the last rod_command came 0.1 s ago'),
    ({'timed_out': True, 'commanding_topic': 'rod_command'}, 'commands', WARN,
     'no rod_command for 0.1 s: the rods hold'),
    ({'abandoned': True}, 'commands', WARN, 'the fins flap, but nobody publishes fin_command any more'),
    ({}, 'disturbances', OK, 'the water is still, no external wrench acts'),
    ({'current': np.array([0.3, 0.0, -0.4])}, 'disturbances', OK,
     'the water flows at 0.5 m/s, no external wrench acts'),
    ({'external_wrench': True, **refused('current', 2)}, 'disturbances', OK, 'the water is still, a body_wrench acts'),
    (refused('current', 9, 2, 'vector.x is nan'), 'disturbances', WARN, '2 current refused just now: vector.x is nan'),
    (refused('body_wrench', 1, 1, 'wrench.force.x is inf'), 'disturbances', WARN,
     '1 body_wrench refused just now: wrench.force.x is inf'),
    ({'diverged_lately': True}, 'motion', ERROR, 'diverged and the robot was put at rest'),
    ({'finite': False}, 'motion', ERROR, 'diverged'),
    ({}, 'power', OK, 'give the fins 6.5 W at 0.33 m/s: cost of transport 0.1'),
    ({'speed': -0.1, 'weight': 98.1}, 'power', OK, 'give the fins 6.5 W at -0.1 m/s: cost of transport 0.66'),
    ({'power': math.nan, 'speed': math.nan}, 'power', OK, 'no simulated time passed'),
    ({}, 'water', OK, 'under water'),
    ({'body_in_water': 0.0, 'fins_in_water': 0.0}, 'water', WARN, 'in the air: the robot falls'),
    ({'body_in_water': 0.0}, 'water', OK, 'at the surface: 0 % of the body and 100 % of the fins are in the water'),
    ({'fins_in_water': 0.999}, 'water', OK, 'at the surface: 100 % of the body and 99 % of the fins'),
    ({'time_step': 0.005}, 'time step', WARN, 'is 0.005 s, but this gait is stable up to about 0.0049 s only'),
])
def test_what_is_wrong_is_said_at_its_level_with_its_numbers(change, matter, level, words):
    said = by_matter(statuses('/manta_sim', dataclasses.replace(WELL, **change)))
    assert said[matter].level == level and words in said[matter].message
    assert {status.level for name, status in said.items() if name != matter} == {OK}


@pytest.mark.parametrize('change', [{'speed': 0.009}, {'speed': -0.009}, {'weight': 0.0}, {'speed': math.nan}])
def test_there_is_no_cost_of_transport_of_a_robot_that_does_not_move_or_has_no_weight(change):
    power = by_matter(statuses('/manta_sim', dataclasses.replace(WELL, **change)))['power']
    assert {value.key: value.value for value in power.values}['cost of transport'] == '-'
    assert 'cost' not in power.message


@pytest.fixture(scope='module')
def robot(module_launch, probe):
    node = module_launch(
        'sim_node', '-p command_timeout:=1.0 -r __ns:=/well -r /clock:=/well/clock -r /diagnostics:=/well/diagnostics')
    node.heard = probe.record(DiagnosticArray, '/well/diagnostics')
    node.commands = probe.node.create_publisher(Float64MultiArray, '/well/fin_command', 10)
    probe.until(lambda: node.heard, 'diagnostics')
    return node


def until_said(robot, probe, matter, words, doing=None):
    def said():
        status = by_matter(robot.heard[-1].status)[matter]
        return words in status.message and status
    probe.until(said, words, doing=doing)
    return said()


def test_a_node_says_once_a_second_how_it_is(robot, probe):
    heard = len(robot.heard)
    probe.until(lambda: len(robot.heard) >= heard + 5, 'five more')
    assert robot.heard.rising
    assert robot.heard.sent[-1] - robot.heard.sent[heard] > 3.6e9  # about a second each
    assert all(status.name.startswith('/well/manta_sim: ') for status in robot.heard[-1].status)


def test_a_node_says_what_became_of_the_commands(robot, probe):
    assert until_said(robot, probe, 'commands', 'no fin_command yet').level == OK
    good, invalid = Float64MultiArray(data=SWIM), Float64MultiArray(data=[0.7])
    assert until_said(robot, probe, 'commands', 'command came', lambda: robot.commands.publish(good)).level == OK
    refused = until_said(robot, probe, 'commands', 'refused just now', lambda: robot.commands.publish(invalid))
    assert refused.level == WARN and 'there are 1 values, but must be 6' in refused.message
    assert until_said(robot, probe, 'commands', 'no fin_command for').level == WARN
    assert until_said(robot, probe, 'commands', 'command came', lambda: robot.commands.publish(good)).level == OK


def test_a_paused_node_goes_on_saying_so(robot, probe):
    client = probe.node.create_client(SetBool, '/well/manta_sim/pause')
    probe.until(client.service_is_ready, 'the service')
    assert until_said(
        robot, probe, 'pace', 'paused', lambda: client.call_async(SetBool.Request(data=True))).level == OK
    heard = len(robot.heard)
    probe.until(lambda: len(robot.heard) >= heard + 2, 'two more')
    until_said(robot, probe, 'pace', 'times real time', lambda: client.call_async(SetBool.Request(data=False)))
    paces = [by_matter(message.status)['pace'] for message in robot.heard[heard:heard + 2]]
    assert {pace.level for pace in paces} == {OK} and all('paused' in pace.message for pace in paces)


def test_power_and_speed_are_means_since_the_last_diagnostics(launch, probe):
    node = LockstepRobot(launch, probe, 'means', '-p start_paused:=true -p step_duration:=2.0 '
                                                 '-r /diagnostics:=/means/diagnostics')
    heard = probe.record(DiagnosticArray, '/means/diagnostics')

    def at_the_end_of_a_step():
        """Return the first two diagnostics with the time of the end of a step."""
        end = f'{node.step() * 1e-9:.3f}'

        def found():
            all_values = [{value.key: value.value for status in message.status for value in status.values}
                          for message in heard]
            return [[values[key] for key in ('mean power of the rods [W]', 'mean forward speed [m/s]',
                                             'cost of transport')]
                    for values in all_values if values['simulated time [s]'] == end]

        probe.until(lambda: len(found()) >= 2, 'two diagnostics')
        return found()[:2]

    assert node.trigger('reset').success
    node.command(SWIM)
    heard.clear()
    probe.until(lambda: len(heard) >= 2, 'the diagnostics of what was before')
    twin = Simulator()
    twin.command(left=FinCommand(*SWIM[::2]), right=FinCommand(*SWIM[1::2]))
    for _ in range(2):  # the second swim is not averaged with the first one
        first, later = at_the_end_of_a_step()
        states = [twin.advance(0.01) for _ in range(200)]
        power, speed = (np.mean(values) for values in zip(*((one.rod_power, one.twist[0]) for one in states)))
        assert first == [f'{value:.3g}' for value in (power, speed, power / (20.0 * 9.81 * speed))]
        assert later == ['-', '-', '-']


def test_a_divergence_is_an_error(launch, probe):
    node = launch('sim_node', '-p solver.time_step:=0.009 -r __ns:=/broken -r /clock:=/broken/clock '
                              '-r /diagnostics:=/broken/diagnostics')
    node.heard = probe.record(DiagnosticArray, '/broken/diagnostics')
    commands = probe.node.create_publisher(Float64MultiArray, '/broken/fin_command', 10)
    probe.until(lambda: node.heard and commands.get_subscription_count(), 'diagnostics')
    command = Float64MultiArray(data=SWIM)
    assert until_said(node, probe, 'motion', 'diverged', lambda: commands.publish(command)).level == ERROR
    assert until_said(node, probe, 'time step', 'is 0.009 s, but this gait is stable up to about').level == WARN


def test_requests_that_were_refused_are_counted_and_commands_that_ended_are_missed(launch, probe):
    robot = LockstepRobot(launch, probe, 'left', '-r /diagnostics:=/left/diagnostics')
    robot.node.heard = probe.record(DiagnosticArray, '/left/diagnostics')
    probe.until(lambda: robot.node.heard, 'diagnostics')

    def counted(name):
        return int({value.key: value.value for value in robot.node.heard[-1].status[1].values}[f'{name} refused'])

    before = counted('parameters'), counted('service calls')
    for name, value in (('publish_rate', math.nan), ('water.current', [math.nan] * 3), ('no_such', 1)):
        assert not robot.set_parameter(name, value).successful
    assert not robot.trigger('step').success
    after = before[0] + 3, before[1] + 1
    probe.until(lambda: (counted('parameters'), counted('service calls')) == after, 'the counts')
    robot.command(SWIM)
    probe.listen(1.5)
    assert 'any more' not in robot.node.heard[-1].status[1].message
    probe.node.destroy_publisher(robot.commands)
    assert until_said(robot.node, probe, 'commands', 'nobody publishes fin_command any more').level == WARN


def test_diagnostics_come_once_a_second_whatever_is_paused_or_paced_meanwhile(launch, probe):
    robot = LockstepRobot(launch, probe, 'restless', '-r /diagnostics:=/restless/diagnostics')
    heard = probe.record(DiagnosticArray, '/restless/diagnostics')
    probe.until(lambda: heard, 'diagnostics')
    states = itertools.cycle((True, False))
    paces = itertools.cycle((1.0, 2.0))

    def change():
        assert robot.pause(next(states)).success
        assert robot.set_parameter('real_time_factor', next(paces)).successful

    count = len(heard)
    probe.until(lambda: len(heard) >= count + 4, 'four more', doing=change, every=0.2)
    assert not any('nan' in by_matter(message.status)['pace'].message for message in heard[count:])


def test_outputs_that_are_rarer_than_diagnostics_are_not_taken_for_a_slow_machine(launch, probe):
    node = launch('sim_node', '-p publish_rate:=0.4 -r __ns:=/rare -r /clock:=/rare/clock '
                              '-r /diagnostics:=/rare/diagnostics')
    node.heard = probe.record(DiagnosticArray, '/rare/diagnostics')
    probe.until(lambda: node.heard, 'diagnostics')
    until_said(node, probe, 'pace', 'times real time')
    probe.until(lambda: len(node.heard) > 2, 'three of them')
    assert not any('at 0 times' in by_matter(message.status)['pace'].message for message in node.heard)
    assert 'real-time factor 0.00' not in node.output
