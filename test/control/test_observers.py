"""What the path follower observes: the current of the water, and what disturbs a turn."""

import math

import pytest

from manta_sim_ros.control.current_observer import CurrentObserver
from manta_sim_ros.control.turn_observer import TurnObserver

STEP = 0.1  # [s]
CURRENT = (0.08, -0.05)  # [m/s]
SIDESLIP = -0.3  # [m]


def observed(duration, yaw_rate, speed, observer=None):
    """Return an observer that was told the motion of a robot with this yaw rate [rad/s] and speed [m/s]."""
    observer = observer or CurrentObserver(0.2, 0.35, (0.5, 2.0), SIDESLIP)
    x, y = CURRENT
    for step in range(round(duration / STEP)):
        heading = yaw_rate * STEP * step
        cos, sin = math.cos(heading), math.sin(heading)
        observer.update(
            STEP, 0.35, heading, speed + cos * x + sin * y, SIDESLIP * yaw_rate + cos * y - sin * x, yaw_rate)
    return observer


def test_the_current_is_found_in_a_turn_with_its_sideslip_although_the_robot_is_slower_than_its_model():
    assert observed(200.0, 0.15, 0.17).current == pytest.approx(CURRENT, abs=0.005)


def test_on_a_straight_line_the_current_across_it_is_found():
    assert observed(20.0, 0.0, 0.17).current[1] == pytest.approx(CURRENT[1], abs=0.002)


def test_a_current_that_is_known_remains_valid_in_a_turn():
    observer = observed(100.0, 0.0, 0.2)
    before = observer.current.copy()
    observed(5.0, 0.3, 0.2, observer)
    assert observer.current == pytest.approx(before, abs=0.01)


def test_the_speed_through_the_water_follows_the_amplitude():
    observer = CurrentObserver(0.2, 0.35, (0.5, 2.0), SIDESLIP)
    speed = 0.0
    for _ in range(300):
        speed += STEP / 2.0 * (0.3 - speed)  # 0.2 m/s more amplitude gives 0.1 m/s more
        observer.update(STEP, 0.55, 0.0, speed, 0.0, 0.0)
    assert observer.current == pytest.approx([0.0, 0.0], abs=1e-3)


def test_the_current_has_a_part_along_a_heading_and_one_to_its_left():
    observer = CurrentObserver(0.2, 0.35, (0.5, 2.0), SIDESLIP)
    observer.current[:] = 0.0, 0.1
    assert observer.along(math.pi / 2.0) == pytest.approx((0.1, 0.0))
    assert observer.along(0.0) == pytest.approx((0.0, 0.1))


def swum(duration, disturbance, response=0.3, lag=0.8):
    """Return an observer of a yaw that steering of 0.1 rad and a disturbance [rad] accelerate, and the yaw rate."""
    observer, rates, rate = TurnObserver(response, lag, 0.3), [], 0.0
    for _ in range(round(duration / STEP)):
        rate += STEP * response * (0.1 + disturbance)
        rates.append(rate)
        recent = rates[-round(2.0 * lag / STEP):]
        observer.update(STEP, 0.1, sum(recent) / len(recent))
    return observer, rate


def test_a_disturbance_of_the_yaw_is_found_as_a_steering_within_its_limit():
    assert swum(30.0, -0.15)[0].disturbance == pytest.approx(-0.15, abs=0.005)
    assert swum(30.0, 0.0)[0].disturbance == pytest.approx(0.0, abs=0.005)
    assert swum(30.0, -0.6)[0].disturbance == -0.3


def test_the_yaw_rate_is_that_of_now_and_not_of_the_middle_of_the_means():
    observer, rate = swum(30.0, -0.25)
    assert observer.rate == pytest.approx(rate, abs=0.005)


def test_what_was_observed_is_forgotten():
    observer, _ = swum(30.0, -0.15)
    observer.reset()
    assert observer.disturbance == observer.rate == 0.0
