"""Parameters, gaits and states that several tests and pieces of evidence share, and comparisons of states."""

import dataclasses
import math
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np

import manta_sim_ros
from manta_sim_ros.dynamics import DivergenceError, FinCommand, Parameters, Simulator, StabilityWarning, State
from manta_sim_ros.dynamics._kernels.constants import constants
from manta_sim_ros.dynamics._kernels.gait import Gait, rod_motion

PACKAGE_ROOT = Path(manta_sim_ros.__file__).parents[1]
"""Where this process imports the package from: the sources, or the place where it is installed."""

SWIM = FinCommand(amplitude=0.7, frequency=0.6, phase=0.7)
TURN = FinCommand(amplitude=0.35, frequency=0.8, phase=0.2, front_bias=0.1, rear_bias=-0.05)
STATE_FIELDS = tuple(field.name for field in dataclasses.fields(State))
MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Signs of the components of a twist or a wrench that is mirrored at the plane y = 0."""
MIRROR_QUATERNION = np.array([-1.0, 1.0, -1.0, 1.0])
"""The same for a quaternion x, y, z, w."""
SIZES = [(2, 1), (2, 3), (3, 10), (7, 4), (15, 2), (16, 3), (17, 3), (20, 10), (30, 3)]
"""Numbers of chains and of links of fins."""
AGREEMENT = 1e-10
"""Tolerance of `fin_dynamics` and its references, relative to the largest entry; measured: below 2e-12 at all SIZES."""
COMMANDS = (
    FinCommand(amplitude=0.7, frequency=0.9, phase=0.6, front_bias=0.1, rear_bias=-0.05),
    FinCommand(amplitude=0.4, frequency=0.6, phase=-0.3, rear_bias=0.2),
)
OTHER_BODY = {
    'water': {'density': 3000.0, 'current': (0.3, -0.2, 0.1)},
    'body': {
        'mass': 12.0, 'inertia': (0.9, 1.1, 1.6), 'drag_area': (0.5, 0.6, 0.9), 'drag_coefficient': (0.3, 0.1, 0.2),
        'angular_damping': (0.3, 0.2, 0.1), 'buoyancy_center': (0.03, -0.02, 0.07), 'gravity': 8.0},
    'rods': {'command_time_constant': 0.0},
}
NO_WATER = {'water': {'density': 0.0}, 'body': {'gravity': 0.0, 'angular_damping': (0.0, 0.0, 0.0)}}
TWIST = {'shear_modulus': 2e6, 'twist_damping': 0.02}
"""Values of the group `fin` with which neighboring chains resist twist."""
SOFT_TWIST = {'shear_modulus': 1e5, 'twist_damping': 1e-4}
"""The same, stable with the default step and many chains."""
WATER_OF_BODY = {
    'added_mass': (7.0, 30.0, 90.0, 1.2, 2.5, 0.6), 'linear_damping': (3.0, 4.0, 6.0, 0.7, 0.9, 0.5),
    'quadratic_damping': (8.0, 20.0, 40.0, 1.5, 3.0, 0.8), 'net_buoyancy': -4.0}
"""Values of the group `body` for all that the water does to the body beyond the paper."""
BARE = {
    'water': {'density': 0.0},
    'fin': {'chains': 2, 'links': 1, 'span': 1e-3, 'thickness': 1e-5, 'density': 1.0, 'youngs_modulus': 1e3,
            'joint_damping': 0.0}}
"""Groups for a body whose fins are so small and light that it does not feel them, without drag."""


def sized(chains, links, **groups):
    """Return parameters of fins with the given numbers of chains and links; `groups` replaces other values."""
    return Parameters().replace(**groups).replace(fin={'chains': chains, 'links': links})


def any_moment(parameters, seed):
    """Return random rod motion, joint angles and rates, body twist and acceleration, larger than those of a robot."""
    random = np.random.default_rng(seed)
    joints = (parameters.fin.chains, parameters.fin.links)
    return (
        random.uniform(-1.0, 1.0, (2, 3)) * [0.7, 4.0, 30.0],
        random.uniform(-0.6, 0.6, joints),
        random.uniform(-4.0, 4.0, joints),
        random.uniform(-1.0, 1.0, 6),
        random.uniform(-5.0, 5.0, 6),
    )


def assert_same_dynamics(actual, desired):
    """Assert that joint accelerations, forces and moments agree."""
    assert_close(actual[0], desired[0], AGREEMENT)
    assert_close(actual[1][:3], desired[1][:3], AGREEMENT)
    assert_close(actual[1][3:], desired[1][3:], AGREEMENT)


def other_parameters(chains, links, seed):
    """Return random parameters: each one that a fin uses differs from its default and from all others."""
    random = np.random.default_rng(seed)
    return sized(
        chains, links,
        water={'density': random.uniform(500.0, 2000.0)},
        rods={'front_radius': random.uniform(0.15, 0.3), 'rear_radius': random.uniform(0.15, 0.3),
              'support_length': random.uniform(0.5, 0.7), 'rear_motor_position': random.uniform(-0.5, 0.5, 3)},
        fin={'span': random.uniform(0.2, 0.5), 'thickness': random.uniform(0.005, 0.02),
             'youngs_modulus': random.uniform(1e6, 1e8), 'joint_damping': random.uniform(0.05, 0.5),
             'drag_coefficient': random.uniform(0.5, 2.0), 'density': random.uniform(700.0, 1500.0)})


def twisting(parameters):
    """Return the parameters with fins that resist twist along the chord."""
    return parameters.replace(fin=TWIST)


def any_state(parameters, seed=1):
    """Return a random state of a moving robot: rotated, accelerated, with bent fins."""
    random = np.random.default_rng(seed)
    joints = (2, parameters.fin.chains, parameters.fin.links)
    orientation = random.normal(size=4)
    return dataclasses.replace(
        State.at_rest(parameters), time=0.3, position=random.uniform(-1.0, 1.0, 3),
        orientation=orientation / np.linalg.norm(orientation), twist=random.uniform(-0.5, 0.5, 6),
        acceleration=random.uniform(-1.0, 1.0, 6), joint_angles=random.uniform(-0.2, 0.2, joints),
        joint_rates=random.uniform(-1.0, 1.0, joints), cycle_angles=random.uniform(0.0, 2.0 * math.pi, 2))


def settled_rods(parameters, start):
    """Return (38) and its derivatives as a function of side and time; `COMMANDS` take effect at once at `start`."""
    def rods(side, time):
        command, psi_dot = COMMANDS[side], 2.0 * math.pi * COMMANDS[side].frequency
        psi = start.cycle_angles[side] + psi_dot * (time - start.time)
        front = math.asin(
            parameters.rods.rear_radius * math.sin(command.amplitude) / parameters.rods.front_radius)
        return np.array([
            [amplitude * math.sin(x) + bias, amplitude * psi_dot * math.cos(x), -amplitude * psi_dot**2 * math.sin(x)]
            for amplitude, x, bias in (
                (front, psi + command.phase, command.front_bias), (command.amplitude, psi, command.rear_bias))])
    return rods


def smoothed_rods(parameters, start):
    """Return the motion of the rods as a function of side and time; `COMMANDS` are smoothed from `start` on."""
    commanded = dataclasses.replace(start, gait_commands=[command.as_array() for command in COMMANDS])
    return lambda side, time: rods_of(parameters, commanded, side, time - start.time)


def rods_of(parameters, state, side, elapsed=0.0):
    """Return the motion of the rods from the simulator's kernel, `elapsed` [s] after the state.

    The rows (2, 3) are the front and the rear rod; the columns are angle, rate and acceleration [rad, s].
    """
    gait = Gait(
        state.gait[side].copy(), state.gait_rates[side].copy(), state.gait_commands[side].copy(),
        state.cycle_angles[side])
    return np.array(rod_motion(constants(parameters).rods, gait, elapsed))


def mirrored(state):
    """Return the state mirrored at the plane y = 0. Adding 0 changes only -0, which becomes +0."""
    exchanged = ('joint_angles', 'joint_rates', 'rod_angles', 'gait', 'gait_rates', 'gait_commands', 'cycle_angles',
                 'rod_rates', 'rod_torques')
    return dataclasses.replace(
        state, position=state.position * MIRROR[:3] + 0.0, orientation=state.orientation * MIRROR_QUATERNION + 0.0,
        twist=state.twist * MIRROR + 0.0, acceleration=state.acceleration * MIRROR + 0.0,
        fin_wrenches=state.fin_wrenches[::-1] * MIRROR + 0.0,
        **{name: getattr(state, name)[::-1] for name in exchanged})


def in_transition(parameters, duration=0.4):
    """Return a simulator in the middle of a transition from one gait to another."""
    simulator = Simulator(parameters)
    simulator.command(left=SWIM, right=SWIM)
    simulator.advance(duration)
    simulator.command(left=SWIM, right=TURN)
    simulator.advance(0.1)
    return simulator


def largest_rate(parameters, time_step, left, right, duration=4.0):
    """Return the largest joint rate [rad/s] of a simulation from rest over `duration` [s]; infinity if it diverges."""
    simulator = Simulator(parameters.replace(solver={'time_step': time_step}))
    largest = 0.0
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', StabilityWarning)
            simulator.command(left=left, right=right)
        interval = max(1, round(0.005 / time_step)) * time_step
        for _ in range(round(duration / interval)):
            largest = max(largest, float(np.abs(simulator.advance(interval).joint_rates).max()))
    except DivergenceError:
        return math.inf
    return largest


def assert_close(actual, desired, relative):
    """Assert that two arrays agree within a tolerance relative to the largest entry of the second."""
    np.testing.assert_allclose(actual, desired, rtol=0.0, atol=relative * np.max(np.abs(desired)))


def bits(state):
    """Return the bytes of every field of a state."""
    return {name: np.asarray(getattr(state, name)).tobytes() for name in STATE_FIELDS}


def assert_same_bits(one, other):
    """Assert that two states agree bit by bit."""
    different = [name for name, value in bits(one).items() if value != bits(other)[name]]
    assert not different


def run_python(code, folder, *arguments, package_root=PACKAGE_ROOT, **variables):
    """Run code in a new process whose working directory is `folder`, and return the finished process."""
    paths = [str(package_root), *filter(None, [os.environ.get('PYTHONPATH')])]
    return subprocess.run(
        [sys.executable, '-c', code, *map(str, arguments)], cwd=folder, check=True, capture_output=True, text=True,
        timeout=300, env={**os.environ, 'PYTHONPATH': os.pathsep.join(paths), **variables})
