"""The node `mpc_follower` with a real simulator in lockstep, without plans, and what it refuses."""

import signal

import pytest
from nav_msgs.msg import Odometry, Path
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

STEP = 0.1  # of the simulator, and between two commands [s]
MOST_STEPS = 200


@pytest.fixture
def mission(tmp_path):
    file = tmp_path / 'mission.yaml'
    file.write_text('waypoints: [[0, 0, 0], [1.2, 0, 0.02]]')
    return file


def test_it_follows_a_mission_and_glides_to_rest_at_its_end(launch, probe, mission):
    launch('sim_node', f'--params-file config/freshwater.yaml -p start_paused:=true -p step_duration:={STEP} '
                       '-p publish_rate:=50.0')
    follower = launch('mpc_follower', f'-p use_sim_time:=true -p mission:={mission} -p time_limit:=1000.0')
    with probe.record(Odometry, 'odom') as odometry, probe.record(Float64MultiArray, 'fin_command') as commands:
        step = probe.node.create_client(Trigger, '/manta_sim/step')
        probe.until(lambda: 'following a path of 1.20 m' in follower.output and step.service_is_ready(), 'both nodes')
        probe.until(lambda: probe.node.count_subscribers('odom') >= 2, 'the subscription of the follower')
        for _ in range(MOST_STEPS):
            due = len(commands) + 1
            probe.until(lambda due=due: len(commands) >= due, 'a command',  # a step or its odometry may be lost
                        doing=lambda: step.call_async(Trigger.Request()), every=5.0)
            if 'the end of the path is reached' in follower.output:
                break
        end = odometry[-1].pose.pose.position
        assert commands[-1].data[:2].tolist() == [0.0, 0.0]
    assert end.x > 1.1 and abs(end.y) < 0.05 and abs(end.z - 0.02) < 0.05
    assert 'no plan' not in follower.output
    follower.send(signal.SIGINT)
    assert follower.exit_status() == 0


def test_without_a_plan_in_time_it_lets_the_robot_glide_and_says_so_once(launch, probe, mission):
    follower = launch('mpc_follower', f'-p mission:={mission} -p time_limit:=1e-6')
    odom = probe.node.create_publisher(Odometry, 'odom', 10)
    stamp = 0

    def swim():
        nonlocal stamp
        stamp += 100_000_000
        message = Odometry()
        message.header.frame_id = 'odom'
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
        message.pose.pose.orientation.w = 1.0
        odom.publish(message)

    with probe.record(Float64MultiArray, 'fin_command') as commands:
        probe.until(lambda: len(commands) > 10, 'commands', doing=swim, every=0.01)
    probe.node.destroy_publisher(odom)
    assert {tuple(command.data[:2]) for command in commands} == {(0.0, 0.0)}
    assert follower.output.count('no plan (Maximum_WallTime_Exceeded): the robot glides to rest') == 1


def test_a_path_is_taken_from_its_topic(launch, probe):
    follower = launch('mpc_follower', '')
    paths = probe.node.create_publisher(Path, 'path', 1)
    message = Path()
    message.header.frame_id = 'map'
    probe.until(lambda: "frame_id is 'map', but must be 'odom'" in follower.output, 'a refusal',
                doing=lambda: paths.publish(message), every=1.0)
    probe.node.destroy_publisher(paths)


@pytest.mark.parametrize(('arguments', 'words'), [
    ('-p speed:=9.0', ['speed is 9.0', 'from 0.02 to 2 m/s']),
    ('-p stages:=1', ['stages is 1', 'from 5 to 100']),
    ('-p model:=/none.yaml', ['/none.yaml', 'No such file']),
    ('-p model:=config/manta.yaml', ['config/manta.yaml', 'must have frequency']),
    ('-p largest_bias:=0.5 -p largest_steering:=1.0', ['at the limits', 'closes only below']),
])
def test_an_invalid_parameter_ends_it_with_one_line(launch, arguments, words):
    (line,) = launch('mpc_follower', arguments).refusal()
    for word in words:
        assert word in line
