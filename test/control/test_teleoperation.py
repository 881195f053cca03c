"""Manual control: the way from keys and a joystick to gaits that the robot follows."""

import itertools
import math
import random

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from manta_sim_ros.control.joystick import JoystickSettings, demand_of
from manta_sim_ros.control.manual import NEUTRAL, Demand, ManualControl, ManualSettings
from manta_sim_ros.control.teleoperation import KEYS, Teleoperation
from manta_sim_ros.dynamics import Parameters, Simulator

LONG = 10.0  # reaches every limit [s]
PERIOD = 0.1  # [s]
ROBOT = Parameters.from_yaml('config/freshwater.yaml').replace(fin={'chains': 6})
SMALL = Parameters().replace(fin={'chains': 2, 'links': 1})


def test_a_demand_is_reached_and_is_mirrored_between_the_fins():
    settings = ManualSettings()
    left, right = ManualControl().update(LONG, Demand(1.0, 1.0, 1.0))
    assert left.amplitude == right.amplitude == settings.largest_amplitude
    assert left.frequency == right.frequency == settings.frequency
    assert (left.phase, right.phase) == pytest.approx(
        (settings.phase - settings.largest_steering, settings.phase + settings.largest_steering))
    assert left.front_bias == right.front_bias == -left.rear_bias == -right.rear_bias == settings.largest_bias
    assert ManualControl().update(LONG, Demand(1.0, -1.0, 1.0)) == (right, left)
    assert ManualControl().update(LONG, Demand(9.0, 9.0, 9.0)) == (left, right)


def test_backward_the_phase_and_the_bias_have_the_other_sign():
    settings = ManualSettings()
    left, right = ManualControl().update(LONG, Demand(-0.5, 1.0, 1.0))
    assert left.amplitude == pytest.approx(0.5 * settings.largest_amplitude)
    assert (left.phase, right.phase) == pytest.approx(
        (-settings.phase - settings.largest_steering, -settings.phase + settings.largest_steering))
    assert left.front_bias == -left.rear_bias == -settings.largest_bias


def test_each_control_changes_at_the_limited_rate():
    control, settings = ManualControl(), ManualSettings()
    left, right = control.update(PERIOD, Demand(1.0, 1.0, -1.0))
    assert left.amplitude == pytest.approx(settings.rate_limit * PERIOD)
    assert right.phase - left.phase == pytest.approx(2.0 * settings.rate_limit * PERIOD)
    assert left.front_bias == pytest.approx(-settings.rate_limit * PERIOD)
    before = control.update(LONG, Demand(1.0, 0.0, 0.0))[0]
    after = control.update(PERIOD, Demand(-1.0, 0.0, 0.0))[0]
    assert before.amplitude - after.amplitude == pytest.approx(settings.rate_limit * PERIOD)
    assert control.update(0.0, NEUTRAL)[0] == after


def test_a_stop_is_at_once():
    control = ManualControl()
    control.update(LONG, Demand(1.0, 1.0, 1.0))
    left, right = control.stop()
    assert left == right and left.amplitude == left.front_bias == left.rear_bias == 0.0
    assert control.update(0.0, Demand(1.0, 1.0, 1.0)) == (left, right)


def test_the_simulator_takes_whatever_is_demanded_and_every_stop():
    """The bound of the mechanism also holds between the gaits, as commands are smoothed."""
    control, simulator, generator = ManualControl(), Simulator(SMALL), random.Random(1)
    for number in range(60):
        demand = Demand(*(generator.choice((-1.0, 0.0, 1.0)) for _ in range(3)))
        for _ in range(generator.randrange(1, 12)):
            left, right = control.update(PERIOD, demand)
            simulator.command(left=left, right=right)  # raises a ValueError where it refuses
            simulator.advance(PERIOD)
        if number % 3 == 0:
            left, right = control.stop()
            simulator.command(left=left, right=right)


def swim(demand):
    """Return forward speed [m/s], yaw rate [rad/s] and climbing speed [m/s], means of three periods."""
    simulator, duration = Simulator(ROBOT), 3.0 / ManualSettings().frequency
    left, right = ManualControl().update(LONG, demand)
    simulator.command(left=left, right=right)
    before = simulator.advance(5.0)
    after = simulator.advance(duration)
    here = Rotation.from_quat(before.orientation)
    moved = here.inv().apply(after.position - before.position)
    turn = here.inv() * Rotation.from_quat(after.orientation)
    return np.array([moved[0], turn.as_euler('ZYX')[0], after.position[2] - before.position[2]]) / duration


@pytest.mark.parametrize('direction', [1.0, -1.0])
def test_the_robot_swims_turns_and_climbs_as_demanded_forward_and_backward(direction):
    straight = swim(Demand(throttle=direction * 0.6))
    assert direction * straight[0] > 0.05
    assert straight[1] == pytest.approx(0.0, abs=1e-3) and straight[2] == pytest.approx(0.0, abs=0.003)
    assert swim(Demand(throttle=direction * 0.6, steer=1.0))[1] > 0.03
    assert swim(Demand(throttle=direction * 0.6, climb=1.0))[2] > 0.01


@pytest.mark.parametrize(('values', 'words'), [
    ({'rate_limit': 0.0}, 'rate_limit is 0.0, but must be from 0.01 to 10 rad/s'),
    ({'largest_bias': 0.5, 'largest_steering': 1.0}, 'at the limits of manual control: '),
])
def test_limits_that_the_rods_cannot_follow_are_refused(values, words):
    with pytest.raises(ValueError, match=words):
        ManualControl(ManualSettings(**values))


def axes(**deflections):
    values = [0.0] * 8
    for name, value in deflections.items():
        values[getattr(JoystickSettings(), f'{name}_axis')] = value
    return values


HELD, FREE = [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 0]


@pytest.mark.parametrize(('settings', 'deflections', 'expected'), [
    ({}, axes(), (0.0, 0.0, 0.0)),
    ({}, axes(throttle=1.0, steer=-1.0, climb=0.5), (1.0, -1.0, 0.45 / 0.95)),
    ({}, axes(throttle=0.05, steer=-0.05), (0.0, 0.0, 0.0)),
    ({}, axes(throttle=7.0), (1.0, 0.0, 0.0)),
    ({'dead_zone': 0.0, 'throttle_scale': -0.5}, axes(throttle=0.4), (-0.2, 0.0, 0.0)),
    ({'throttle_axis': 7}, [0.0] * 7 + [1.0], (1.0, 0.0, 0.0)),
])
def test_axes_become_a_demand(settings, deflections, expected):
    assert demand_of(JoystickSettings(**settings), deflections, HELD) == pytest.approx(expected)


def test_without_the_dead_man_button_there_is_no_demand():
    assert demand_of(JoystickSettings(), axes(throttle=1.0), FREE) is None
    assert demand_of(JoystickSettings(dead_man_button=0), axes(throttle=1.0), HELD) is None


@pytest.mark.parametrize(('deflections', 'buttons', 'words'), [
    (axes(), [1, 1, 1, 1], 'there are 4 buttons, but joy.dead_man_button is 4, counted from 0'),
    ([0.0] * 4, HELD, 'there are 4 axes, but joy.climb_axis is 4, counted from 0'),
    (axes(steer=math.nan), HELD, 'axis 0 is nan, but must be from -1 to 1'),
])
def test_a_message_that_does_not_fit_is_refused(deflections, buttons, words):
    with pytest.raises(ValueError, match=words):
        demand_of(JoystickSettings(), deflections, buttons)


@pytest.fixture
def teleoperation():
    return Teleoperation(ManualControl(), JoystickSettings(timeout=0.5))


def amplitude(gaits):
    assert gaits[0].amplitude == gaits[1].amplitude
    return gaits[0].amplitude


def test_keys_change_the_demand_in_steps_up_to_the_limits(teleoperation):
    assert teleoperation.command(0.0) is None  # nobody has commanded yet
    for _ in range(3):
        teleoperation.press('faster')
    teleoperation.press('left')
    teleoperation.press('down')
    assert teleoperation.demand == (0.3, 0.2, -0.2)
    assert amplitude(teleoperation.command(LONG)) == pytest.approx(0.3 * ManualSettings().largest_amplitude)
    for key, part in (('slower', -1.0), ('faster', 1.0)):
        for _ in range(30):
            teleoperation.press(key)
        assert teleoperation.demand.throttle == part
    teleoperation.press('center')
    assert teleoperation.demand == (1.0, 0.0, 0.0)
    teleoperation.press('stop')
    assert teleoperation.demand == NEUTRAL and amplitude(teleoperation.command(LONG)) == 0.0


def test_two_keys_of_a_pair_undo_each_other(teleoperation):
    for there, back in (('faster', 'slower'), ('left', 'right'), ('up', 'down')):
        assert np.add(KEYS[there].change, KEYS[back].change).tolist() == [0.0, 0.0, 0.0]
        assert max(KEYS[there].change) > 0.0


def test_the_fins_stop_when_the_dead_man_button_is_released(teleoperation):
    for now in itertools.takewhile(lambda now: now < 1.0, itertools.count(0.0, PERIOD)):
        teleoperation.hear(Demand(throttle=1.0), now)
        teleoperation.command(now)
    assert teleoperation.held and amplitude(teleoperation.gaits) > 0.5
    teleoperation.press('slower')  # no key but stop counts meanwhile
    assert teleoperation.demand.throttle == 1.0
    teleoperation.hear(None, 1.0)
    assert not teleoperation.held and amplitude(teleoperation.command(1.0)) == 0.0
    teleoperation.press('faster')
    assert amplitude(teleoperation.command(LONG)) > 0.0
    teleoperation.hear(None, LONG)  # a joystick that lies on the table does not stop what the keys command
    assert amplitude(teleoperation.command(LONG)) > 0.0


@pytest.mark.parametrize('why', ['silence', 'stop'])
def test_after_silence_or_a_stop_by_key_the_button_must_be_released_first(teleoperation, why):
    teleoperation.hear(Demand(throttle=1.0), 0.0)
    assert amplitude(teleoperation.command(0.0)) == 0.0 and amplitude(teleoperation.command(0.5)) > 0.0
    if why == 'stop':
        teleoperation.press('stop')
    assert amplitude(teleoperation.command(0.6)) == 0.0 and not teleoperation.held
    assert teleoperation.trouble
    teleoperation.hear(Demand(throttle=1.0), 0.7)
    assert amplitude(teleoperation.command(LONG)) == 0.0
    teleoperation.hear(None, LONG)
    assert not teleoperation.trouble
    teleoperation.hear(Demand(throttle=1.0), LONG)
    assert amplitude(teleoperation.command(LONG + 0.4)) > 0.0
