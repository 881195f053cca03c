"""The path follower in closed loop with the simulator, without ROS: errors, limits, gains, refusals."""

import dataclasses
import math

import numpy as np
import pytest

from evidence.control_report.courses import COURSES, OF_HEIGHT
from evidence.control_report.robots import CONFIG, FOR_PAPER, ROBOTS
from evidence.control_report.swims import Row, swim, verdict
from manta_sim_ros.control.averaging import PeriodAverage
from manta_sim_ros.control.closed_loop import CONTROL_PERIOD, fly
from manta_sim_ros.control.design import design, main
from manta_sim_ros.control.follower import Loop, PathFollower
from manta_sim_ros.control.mission import path_of
from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.control.settings import FollowerSettings
from manta_sim_ros.dynamics import read_sections, values_for


@pytest.mark.parametrize(('robot', 'course', 'condition'), [
    ('freshwater', 'helix', 'current'), ('freshwater', 'lawnmower', 'calm'), ('freshwater', 'lawnmower', 'current'),
    ('freshwater', 'waypoints', 'calm'), ('manta', 'helix', 'calm')])
def test_the_robot_stays_near_the_path_within_its_limits(robot, course, condition):
    row = Row(robot, course, condition, 'path_follower')
    one, settings = swim(row, 0, lambda: None), ROBOTS[robot].settings
    flight, found = one.flight, verdict(row, one.result)
    assert flight.finished
    assert found.met and found.height_met
    angles = flight.commands[:, :, [0, 2, 3, 4]]
    assert not angles[0, :, 0].any()
    assert np.abs(np.diff(angles[:-1], axis=0)).max() < settings.rate_limit * CONTROL_PERIOD + 1e-9
    assert angles[:, :, 0].max() <= settings.largest_amplitude
    assert np.abs(angles[:, :, 1] - settings.phase).max() <= settings.largest_steering + 1e-9
    assert np.abs(angles[:, :, 2:]).max() <= settings.largest_bias


def test_a_robot_that_keeps_station_stays_within_its_radius_in_a_current():
    parameters, settings, *_ = ROBOTS['freshwater']
    center, radius = (0.0, 2.0, 0.0), 3.0
    path = path_of({'station_keeping': {'center': center, 'radius': radius, 'turns': 1}})
    swimming = parameters.replace(water={'current': (0.1, 0.0, 0.0)})
    flight = fly(swimming, PathFollower(path, settings, parameters), path, 150.0)
    assert flight.finished
    assert np.linalg.norm(flight.position[:, :2] - center[:2], axis=1).max() < radius
    assert np.abs(flight.height).max() < OF_HEIGHT


def test_the_default_gains_are_those_of_the_linear_model_in_fresh_water():
    parameters, settings, *_ = ROBOTS['freshwater']
    computed = design(parameters, settings)
    for name in ('speed', 'speed_model', 'turn_response', 'sideslip', 'steering_gains', 'depth_gains', 'speed_gains'):
        np.testing.assert_allclose(getattr(settings, name), getattr(computed, name), rtol=0.02, atol=1e-3)


def test_path_gains_prints_the_parameter_file_of_the_paper(capsys, tmp_path):
    main(['--config', str(CONFIG / 'manta.yaml'), '--amplitude', '25'])
    printed = tmp_path / 'gains.yaml'
    printed.write_text(capsys.readouterr().out)
    values = values_for('/manta_path_follower', read_sections(printed))
    assert values.keys() == FOR_PAPER.keys()
    for name, value in values.items():
        np.testing.assert_allclose(value, FOR_PAPER[name], rtol=0.02, atol=1e-3)


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--amplitude', '90'], '--amplitude is 90, but must be from 2.9 to 57.3 degrees'),
    (['--frequency', '9'], 'frequency is 9.0, but must be from 0.1 to 2'),
    (['--config', '/none.yaml'], '/none.yaml')])
def test_wrong_input_of_path_gains_ends_it_with_one_line_and_status_2(arguments, words, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


def test_the_mean_over_a_period_has_nothing_of_the_stroke_and_no_jump_of_the_heading():
    average = PeriodAverage(2.0)
    for step in range(101):
        time = 0.1 * step
        heading = 3.0 + 0.2 * time + 0.3 * math.sin(math.pi * time)
        quaternion = np.array([0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading)])
        average.add(time, np.full(3, math.cos(math.pi * time)), quaternion, np.full(6, 1.0 + math.sin(math.pi * time)))
    mean = average.mean
    np.testing.assert_allclose(mean.position, 0.0, atol=1e-12)
    np.testing.assert_allclose(mean.twist, 1.0, atol=1e-12)
    np.testing.assert_allclose(mean.attitude, [0.0, 0.0, 3.0 + 0.2 * 9.05], atol=1e-12)


def test_steering_begins_when_the_means_are_over_a_whole_period():
    follower = PathFollower(Polyline([[0.0, 1.0, 0.0], [5.0, 1.0, 0.0]]))
    steered = []
    for step in range(20):
        follower.observe(0.1 * step, np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(6))
        left, right = follower.command(0.1 * step)
        steered.append(right.phase > left.phase)
    assert steered == [0.1 * step >= follower.settings.period for step in range(20)]


def test_when_time_goes_back_the_mean_begins_again():
    average = PeriodAverage(2.0)
    for time, place in ((5.0, 7.0), (1.0, 3.0)):
        average.add(time, np.full(3, place), np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(6))
    np.testing.assert_array_equal(average.mean.position, 3.0)


def test_the_integral_does_not_wind_up_at_the_limit():
    loop = Loop((1.0, 0.1), -0.5, 0.5, rate=10.0)
    for _ in range(1000):
        loop.regulate(0.1, [2.0])
    assert loop.control == -0.5 and loop.integral == 0.0
    for _ in range(10):
        loop.regulate(0.1, [0.1])
    assert loop.control == pytest.approx(-0.1, abs=0.02)
    assert loop.integral == pytest.approx(0.1)


def test_at_the_end_and_without_odometry_the_robot_glides_to_rest():
    follower = PathFollower(Polyline([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    level = np.array([0.0, 0.0, 0.0, 1.0])
    follower.observe(0.0, np.zeros(3), level, np.zeros(6))
    follower.command(0.0)
    follower.observe(0.1, np.zeros(3), level, np.zeros(6))
    assert follower.command(0.1)[0].amplitude > 0.0
    assert [fin.amplitude for fin in follower.glide()] == [0.0, 0.0]
    follower.observe(10.0, np.zeros(3), level, np.zeros(6))
    assert follower.command(10.0)[0].amplitude == 0.0  # the stroke begins again from rest
    follower.observe(20.0, np.array([1.1, 0.0, 0.0]), level, np.zeros(6))
    assert follower.command(20.0)[0].amplitude == 0.0 and follower.finished


def test_another_path_is_followed_without_a_break_of_the_stroke():
    follower = PathFollower(Polyline([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]]))
    for step in range(30):
        follower.observe(0.1 * step, np.array([0.1 * step, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(6))
        before, _ = follower.command(0.1 * step)
    follower.follow(Polyline([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
    left, right = follower.command(3.0)
    assert left.amplitude == pytest.approx(before.amplitude, abs=0.1) and before.amplitude > 0.2
    assert left.phase < right.phase  # to the left
    assert not follower.finished


def test_a_rest_between_two_paths_is_not_taken_for_a_current():
    follower = PathFollower(Polyline([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0]]))
    position = speed = 0.0
    for step in range(700):  # swims for 30 s, then glides to rest, and has another path at the end
        speed += 0.1 / 2.8 * ((0.22 if position < 6.0 else 0.0) - speed)
        position += 0.1 * speed
        if step == 680:
            assert follower.finished
            follower.follow(Polyline([[6.0, 0.0, 0.0], [9.0, 0.0, 0.0]]))
        twist = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])
        follower.observe(0.1 * step, np.array([position, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]), twist)
        left, _ = follower.command(0.1 * step)
    assert left.amplitude > 0.2 and not follower.finished
    assert np.linalg.norm(follower.current) < 0.075


def test_a_path_is_rounded_at_its_corners_and_has_two_sides():
    path = Polyline([[0.0, 0.0, 0.0], [2.0, 0.0, 0.2], [2.0, 2.0, 0.2]])
    assert path.length == 4.0
    assert path.course(0.0, 1.0) == path.course(1.5, 1.0) == 0.0
    assert path.course(2.0, 1.0) == pytest.approx(math.pi / 4.0)
    assert path.course(2.5, 1.0) == path.course(4.0, 1.0) == pytest.approx(math.pi / 2.0)
    assert path.project([1.0, 0.3, 0.0], 0.0, 4.0) == pytest.approx((1.0, 0.3, -0.1))
    assert path.project([2.5, 1.0, 0.5], 0.0, 4.0) == pytest.approx((3.0, -0.5, 0.3))
    assert path.project([2.5, 1.0, 0.5], 0.0, 1.0).station == 1.0  # not beyond what is searched


@pytest.mark.parametrize('turns', [1.0, -1.0])
def test_a_circle_has_the_course_of_its_tangent_and_its_curvature(turns):
    path = path_of({'circle': {'radius': 2.0, 'turns': turns}})
    for share in (0.25, 0.5, 0.75):
        course = math.remainder(2.0 * math.pi * turns * share - path.course(share * path.length, 1.8), 2.0 * math.pi)
        assert course == pytest.approx(0.0, abs=0.01)
        assert path.curvature(share * path.length, 1.8) == pytest.approx(0.5 * turns, rel=0.05)


@pytest.mark.parametrize(('waypoints', 'words'), [
    ([], ['0 waypoints', 'from 2']),
    ([[0.0, 0.0, 0.0]], ['1 waypoints', 'from 2']),
    ([[0.0, 0.0, 0.0], [1.0, math.nan, 0.0]], ['waypoint 1', 'nan', '100000 m']),
    ([[0.0, 0.0, 0.0], [1.0, 0.0]], ['waypoint 1', 'three numbers']),
    ([[0.0, 0.0, 0.0], 'up'], ['waypoint 1', "'up'", 'three numbers']),
    ([[0.0, 0.0, 0.0], 3.0], ['waypoint 1', '3.0', 'three numbers']),
    ([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], ['waypoint 1', '0 m', 'at least 0.01 m']),
    ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.5]], ['waypoint 1', 'slope of 0.5', '0.2']),
])
def test_a_path_that_cannot_be_followed_is_refused(waypoints, words):
    with pytest.raises(ValueError) as refused:
        Polyline(waypoints)
    assert all(word in str(refused.value) for word in words)


def test_limits_beyond_the_mechanism_are_refused():
    settings = dataclasses.replace(FollowerSettings(), largest_amplitude=1.0, largest_bias=0.5, largest_steering=1.0)
    with pytest.raises(ValueError, match='at the limits of the path follower: left amplitude .* closes only below'):
        PathFollower(COURSES['straight'].path, settings)
