"""The node `teleop`: with a joystick, and with keys in a terminal."""

import contextlib
import fcntl
import math
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import threading

import pytest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Float64MultiArray

from evidence.harness.processes import LIMIT, command_of, own_lines
from manta_sim_ros.control.joystick import JoystickSettings
from manta_sim_ros.control.manual import ManualSettings
from manta_sim_ros.nodes.messages import ROD_NAMES, fin_commands

RESTORED = b'\x1b[?1049l'
"""What leaves the alternate screen."""


def joy(throttle=0.0, held=True, axes=8):
    message = Joy(axes=[0.0] * axes, buttons=[0] * 12)
    if axes > 4:
        message.axes[JoystickSettings().throttle_axis] = throttle
    message.buttons[JoystickSettings().dead_man_button] = int(held)
    return message


def amplitude(commands):
    left, right = fin_commands(commands[-1].data)
    assert left.amplitude == right.amplitude
    return left.amplitude


@pytest.fixture
def commands(probe):
    with probe.record(Float64MultiArray, 'fin_command') as recording:
        yield recording


@pytest.fixture
def joysticks(probe):
    publisher = probe.node.create_publisher(Joy, 'joy', 10)
    yield publisher
    probe.node.destroy_publisher(publisher)


def test_a_joystick_drives_the_fins_while_its_button_is_held_and_the_end_stops_them(
        launch, probe, commands, joysticks):
    node = launch('teleop', '-p joy.timeout:=5.0')
    probe.until(joysticks.get_subscription_count, 'the node')
    node.wait_for_output('there is no terminal, so no screen and no keys: joy commands')

    def hold(until, what, **message):
        probe.until(until, what, doing=lambda: joysticks.publish(joy(**message)), every=0.05)

    full = ManualSettings().largest_amplitude
    hold(lambda: commands and amplitude(commands) == full, 'full throttle', throttle=1.0)
    hold(lambda: amplitude(commands) == 0.0, 'rest', throttle=1.0, held=False)
    hold(lambda: amplitude(commands) == full, 'full throttle again', throttle=1.0)
    probe.until(lambda: amplitude(commands) == 0.0, 'rest after silence')  # nobody publishes joy
    joysticks.publish(joy(throttle=1.0))
    heard = len(commands)
    hold(lambda: len(commands) > heard + 5, 'five commands', throttle=1.0)
    assert {command.data[0] for command in commands[heard:]} == {0.0}  # the button was not released
    hold(lambda: 'joy refused' in node.output, 'a refusal', axes=2)
    assert 'there are 2 axes, but joy.throttle_axis is 1' not in node.output
    assert 'there are 2 axes, but joy.climb_axis is 4, counted from 0' in node.output
    heard = len(commands)
    hold(lambda: len(commands) > heard + 5, 'a released button', held=False)
    hold(lambda: amplitude(commands) == full, 'full throttle at last', throttle=1.0)
    node.send(signal.SIGTERM)
    probe.until(lambda: amplitude(commands) == 0.0, 'rest at the end')
    assert node.exit_status() == 0
    assert 'Traceback' not in node.output


class Terminal:
    """A program in a terminal of its own, of 80 columns and 24 lines; what it draws is read all the time."""

    def __init__(self, command):
        self.master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack('HHHH', 24, 80, 0, 0))
        self.before = termios.tcgetattr(self.master)
        self.drawn = b''
        self.process = subprocess.Popen(
            command, stdin=slave, stdout=slave, stderr=slave, start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0), env=os.environ | {'TERM': 'xterm-256color'})
        os.close(slave)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        with contextlib.suppress(OSError):  # at its end
            while part := os.read(self.master, 65536):
                self.drawn += part

    @property
    def text(self):
        return re.sub(r'\x1b\[[0-9;?<>=]*\$?[a-zA-Z]', '', self.drawn.decode(errors='replace'))

    def type(self, keys):
        os.write(self.master, keys)

    def close(self):
        with contextlib.suppress(OSError):
            os.close(self.master)

    def end(self):
        if self.process.poll() is None:
            self.process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(LIMIT)
        self.process.kill()
        self.close()


@pytest.fixture
def terminal(tmp_path):
    opened = []

    def open_terminal(command):
        opened.append(Terminal(command))
        return opened[-1]

    yield open_terminal
    for each in opened:
        each.end()


UP = b'\x1b[A'


def flapping(terminal, probe, commands):
    """Return a terminal in which the keys have made the fins flap."""
    pytest.importorskip('textual')
    shown = terminal(command_of('teleop'))
    probe.until(lambda: 'waiting for /odom' in shown.text, 'the screen')
    shown.type(UP * 3)
    largest = ManualSettings().largest_amplitude
    probe.until(lambda: commands and amplitude(commands) == pytest.approx(0.3 * largest), 'a stroke')
    return shown


def test_keys_drive_the_fins_and_the_screen_shows_what_the_robot_publishes(terminal, probe, commands):
    shown = flapping(terminal, probe, commands)
    odometry, joints = Odometry(), JointState(name=ROD_NAMES, position=[math.radians(33.3)] * 4)
    odometry.pose.pose.orientation.w = 1.0
    odometry.pose.pose.position.z, odometry.twist.twist.linear.x = -7.125, 0.875
    with contextlib.ExitStack() as stack:
        publishers = {
            kind: probe.node.create_publisher(kind, topic, 10)
            for kind, topic in ((Odometry, 'odom'), (JointState, 'joint_states'))}
        for publisher in publishers.values():
            stack.callback(probe.node.destroy_publisher, publisher)

        def publish():
            odometry.header.stamp.sec += 1
            publishers[Odometry].publish(odometry)
            publishers[JointState].publish(joints)

        probe.until(lambda: all(words in shown.text for words in ('7.125', '0.875', '33.3°', 'Nothing is wrong')),
                    'the robot on the screen', doing=publish, every=0.2)
    shown.type(b'  ')
    probe.until(lambda: amplitude(commands) == 0.0, 'rest')
    shown.type(b'w')
    probe.until(lambda: amplitude(commands) > 0.0, 'a stroke again')
    assert RESTORED not in shown.drawn
    shown.type(b'q')
    probe.until(lambda: shown.process.poll() is not None and amplitude(commands) == 0.0, 'the end')
    assert shown.process.returncode == 0
    probe.until(lambda: RESTORED in shown.drawn, 'the restored terminal')
    assert termios.tcgetattr(shown.master) == shown.before


@pytest.mark.parametrize('ending', ['ctrl-c', 'SIGTERM', 'closed terminal'])
def test_whatever_ends_it_the_fins_stop_and_the_terminal_is_restored(terminal, probe, commands, ending):
    shown = flapping(terminal, probe, commands)
    if ending == 'ctrl-c':
        shown.type(b'\x03')
    elif ending == 'closed terminal':
        shown.close()
    else:
        shown.process.send_signal(getattr(signal, ending))
    probe.until(lambda: shown.process.poll() is not None and amplitude(commands) == 0.0, 'the end')
    assert shown.process.returncode == 0
    if ending != 'closed terminal':
        probe.until(lambda: RESTORED in shown.drawn, 'the restored terminal')
        assert termios.tcgetattr(shown.master) == shown.before
        assert 'Traceback' not in shown.text


LACKING = """
import sys
from manta_sim_ros import executables
sys.modules['textual'] = None
sys.argv = ['teleop']
executables.teleop()
"""


def test_without_textual_one_line_names_the_extra_and_the_way_without_a_screen(terminal):
    shown = terminal([sys.executable, '-c', LACKING])
    assert shown.process.wait(LIMIT) == 1
    shown._reader.join(LIMIT)
    (line,) = own_lines(shown.text)
    assert line.startswith('teleop: ') and "pip install 'manta_sim_ros[control]'" in line and 'screen:=false' in line


@pytest.mark.parametrize(('arguments', 'words'), [
    ('-p joy.timeout:=99.0', ['joy.timeout is 99.0', 'from 0.1 to 10 s']),
    ('-p joy.throttle_axis:=-1', ['joy.throttle_axis is -1', 'from 0 to 31']),
    ('-p largest_bias:=0.5 -p largest_steering:=1.0', ['at the limits of manual control', 'closes only below']),
    ('-p robot:=/none.yaml', ['/none.yaml', 'No such file']),
])
def test_an_invalid_parameter_ends_it_with_one_line(launch, arguments, words):
    (line,) = launch('teleop', arguments).refusal()
    for word in words:
        assert word in line
