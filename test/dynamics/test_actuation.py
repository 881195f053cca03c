"""The support's pose and motion against geometry and against finite differences."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from evidence.scenarios import assert_close
from manta_sim_ros.dynamics import Parameters
from manta_sim_ros.dynamics._kernels.actuation import BodyMotion, support_motion
from manta_sim_ros.dynamics._kernels.constants import constants
from manta_sim_ros.dynamics._kernels.gait import Rod
from manta_sim_ros.dynamics.command import closure_angle

H = 1e-3  # [s], step of the fourth-order differences below
OFFSETS = H * np.array([-2.0, -1.0, 1.0, 2.0])


def rate(values):
    """Return the derivative in the middle of values at the four `OFFSETS`."""
    far_before, before, after, far_after = values
    return (8.0 * (after - before) - (far_after - far_before)) / (12.0 * H)


def vee(matrix):
    return np.array([matrix[2, 1], matrix[0, 2], matrix[1, 0]])


class SmoothMotion:
    """Rods and a body whose motions are sums of two sines, known with their derivatives; frequencies near 1 Hz."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self._scale = random.uniform(0.1, 0.3, (2, 8))
        self._frequency = random.uniform(2.0, 6.0, (2, 8))
        self._start = random.uniform(0.0, 2.0 * math.pi, (2, 8))

    def _derivative(self, order, time):
        angle = self._frequency * time + self._start + 0.5 * math.pi * order
        return np.sum(self._scale * self._frequency**order * np.sin(angle), axis=0)

    def rod(self, index, time):
        return Rod(*(float(self._derivative(order, time)[6 + index]) for order in range(3)))

    def twist(self, time):
        return self._derivative(0, time)[:6]

    def acceleration(self, time):
        return self._derivative(1, time)[:6]

    def body_pose(self, time):
        """Return R_b and the position in the frame of F_b at time 0, integrated to 1e-13."""
        def slope(at, pose):
            rotation, velocity, omega = pose[:9].reshape(3, 3), *np.split(self.twist(at), 2)
            return np.concatenate([np.cross(rotation, omega).ravel(), rotation @ velocity])

        start = np.concatenate([np.eye(3).ravel(), np.zeros(3)])
        pose = solve_ivp(slope, (0.0, time), start, method='DOP853', rtol=1e-13, atol=1e-15).y[:, -1]
        return pose[:9].reshape(3, 3), pose[9:]

    def support(self, parameters, time):
        """Return lR_0, the position of A, eta_0 and its derivative, of the compiled code."""
        body = BodyMotion(*(
            tuple(part.tolist()) for motion in (self.twist(time), self.acceleration(time))
            for part in np.split(motion, 2)))
        support = support_motion(constants(parameters).rods, self.rod(0, time), self.rod(1, time), body)
        twist, acceleration = support.velocity + support.omega, support.velocity_dot + support.omega_dot
        return np.array(support.rotation), np.array(support.position), np.array(twist), np.array(acceleration)


@pytest.mark.parametrize('seed', range(5))
def test_the_supports_twist_is_the_derivative_of_its_pose(seed):
    parameters, motion = Parameters(), SmoothMotion(seed)
    rotations, positions = [], []
    for time in OFFSETS:
        body_rotation, body_position = motion.body_pose(time)
        rotation, position, _, _ = motion.support(parameters, time)
        rotations.append(body_rotation @ rotation)
        positions.append(body_position + body_rotation @ position)
    rotation, _, twist, _ = motion.support(parameters, 0.0)
    # derived: H^4 / 30 times a fifth derivative of some 1e4, 3e-10; rounding 1e-14 / H. Measured: below 6e-11
    assert_close(twist[:3], rotation.T @ rate(positions), 1e-9)
    assert_close(twist[3:], vee(rotation.T @ rate(rotations)), 1e-9)


@pytest.mark.parametrize('seed', range(5))
def test_the_supports_acceleration_is_the_derivative_of_its_twists_components(seed):
    parameters, motion = Parameters(), SmoothMotion(seed)
    twists = [motion.support(parameters, time)[2] for time in OFFSETS]
    acceleration = motion.support(parameters, 0.0)[3]
    # as above, with the sixth derivative of the pose. Measured: below 5e-10
    assert_close(acceleration[:3], rate(twists)[:3], 5e-9)
    assert_close(acceleration[3:], rate(twists)[3:], 5e-9)


@pytest.mark.parametrize('radii', [(0.235, 0.185), (0.15, 0.28)])
def test_the_support_reaches_from_rod_to_rod_and_keeps_its_length(radii):
    front_radius, rear_radius = radii
    parameters = Parameters().replace(rods={'front_radius': front_radius, 'rear_radius': rear_radius})
    rods = parameters.rods
    random = np.random.default_rng(1)
    still = BodyMotion(*((0.0, 0.0, 0.0),) * 4)
    for _ in range(200):
        rear = random.uniform(-1.5, 1.5)
        front = rear + random.uniform(-1.0, 1.0) * (closure_angle(rods) - 1e-3)
        motor = tuple(random.uniform(-0.5, 0.5, 3).tolist())
        support = support_motion(
            constants(parameters).rods._replace(motor_position=motor), Rod(front, 0.0, 0.0), Rod(rear, 0.0, 0.0), still)
        rotation, from_motor = np.array(support.rotation), np.array(support.position) - motor
        b = from_motor + rods.support_length * rotation[:, 0]
        rounding = 1e-13  # derived: numbers of order 1; a root near closure costs two digits
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=rounding)
        assert np.linalg.det(rotation) > 0.0
        np.testing.assert_allclose(
            from_motor, [0.0, rear_radius * math.cos(rear), rear_radius * math.sin(rear)], atol=rounding)
        np.testing.assert_allclose(
            b[1:], [front_radius * math.cos(front), front_radius * math.sin(front)], atol=rounding)
        assert b[0] > 0.0  # x_0 points forward
        assert rotation[2, 1] == 0.0 and rotation[1, 1] > 0.0  # y_0 is level and points outward
