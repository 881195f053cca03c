"""The sensors read the truth of a state with their bias and noise, and nothing else."""

import dataclasses
import itertools
import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evidence.scenarios import SWIM, TURN, sized
from manta_sim_ros.dynamics import LARGEST_SEED, MONOLITHIC, SEQUENTIAL, Simulator, State, gaussian_noise, random_walk
from manta_sim_ros.sensors import (
    IMU_STREAM,
    Imu,
    OdometryNoise,
    Pressure,
    Velocity,
    read_imu,
    read_odometry,
    read_pressure,
    read_velocity,
)

EXACT_IMU = Imu(acceleration_noise=0.0, angular_velocity_noise=0.0, orientation_noise=0.0)
EXACT_PRESSURE = Pressure(noise=0.0)
PARAMETERS = sized(3, 2)
G = PARAMETERS.body.gravity
READINGS = 4000
SCATTER = 5.0 / math.sqrt(2.0 * READINGS)
"""Five standard deviations of a standard deviation that is estimated from so many readings, relative."""


def state(**values):
    return dataclasses.replace(State.at_rest(PARAMETERS), **values)


def readings(read, sensor, of=None):
    """Return what a sensor reads in one state at many times."""
    of = state() if of is None else of
    return [read(sensor, PARAMETERS, dataclasses.replace(of, time=0.01 * tick)) for tick in range(READINGS)]


def without_parameters(read):
    """Return how a sensor reads that needs no parameters of the model, as one that does."""
    return lambda sensor, parameters, of: read(sensor, of)


def test_at_rest_the_specific_force_is_gravity_upward():
    reading = read_imu(EXACT_IMU, PARAMETERS, state())
    np.testing.assert_array_equal(reading.specific_force, [0.0, 0.0, G])
    np.testing.assert_array_equal(reading.angular_velocity, 0.0)
    np.testing.assert_array_equal(reading.orientation, [0.0, 0.0, 0.0, 1.0])


def test_turned_and_moving_the_reading_is_that_of_mechanics():
    attitude, random = Rotation.from_rotvec([0.4, -0.7, 1.1]), np.random.default_rng(3)
    twist, acceleration = random.uniform(-1.0, 1.0, (2, 6))
    reading = read_imu(EXACT_IMU, PARAMETERS, state(
        orientation=attitude.as_quat(), twist=twist, acceleration=acceleration))
    expected = acceleration[:3] + np.cross(twist[3:], twist[:3]) + attitude.inv().apply([0.0, 0.0, G])
    np.testing.assert_allclose(reading.specific_force, expected, rtol=0.0, atol=1e-14)  # derived: some roundings of 10
    np.testing.assert_array_equal(reading.angular_velocity, twist[3:])
    np.testing.assert_allclose(reading.orientation, attitude.as_quat(), rtol=0.0, atol=1e-15)


@pytest.mark.parametrize('coupling', [SEQUENTIAL, MONOLITHIC])
def test_dead_reckoning_with_an_exact_imu_finds_the_velocity_of_a_swim(coupling):
    parameters = PARAMETERS.replace(solver={'coupling': coupling})
    simulator = Simulator(parameters)
    simulator.command(left=SWIM, right=TURN)
    simulator.advance(0.5)

    def world_acceleration(of):
        reading = read_imu(EXACT_IMU, parameters, of)
        return Rotation.from_quat(reading.orientation).apply(reading.specific_force) - [0.0, 0.0, G]

    def world_velocity(of):
        return Rotation.from_quat(of.orientation).apply(np.array(of.twist[:3]))

    dt = parameters.solver.time_step
    states = [simulator.state] + [simulator.advance(dt) for _ in range(1500)]
    rates = np.array([world_acceleration(of) for of in states])
    gained = 0.5 * dt * (rates[1:] + rates[:-1]).sum(axis=0)
    change = world_velocity(states[-1]) - world_velocity(states[0])
    assert np.linalg.norm(change) > 0.1
    # measured: 1.0e-4 m/s, the acceleration being that of a step before; 1.4e-6 m/s together, of second order
    np.testing.assert_allclose(gained, change, rtol=0.0, atol=3e-4 if coupling == SEQUENTIAL else 4e-6)


def test_a_bias_is_added():
    imu = dataclasses.replace(
        EXACT_IMU, acceleration_bias=(0.1, -0.2, 0.3), angular_velocity_bias=(-0.01, 0.02, 0.03))
    reading = read_imu(imu, PARAMETERS, state(twist=np.full(6, 0.5)))
    exact = read_imu(EXACT_IMU, PARAMETERS, state(twist=np.full(6, 0.5)))
    np.testing.assert_allclose(reading.specific_force - exact.specific_force, imu.acceleration_bias, atol=1e-14)
    np.testing.assert_allclose(reading.angular_velocity - exact.angular_velocity, imu.angular_velocity_bias, atol=1e-16)
    pressure = dataclasses.replace(EXACT_PRESSURE, bias=-250.0)
    assert read_pressure(pressure, PARAMETERS, state()) == read_pressure(EXACT_PRESSURE, PARAMETERS, state()) - 250.0


def test_the_noise_has_the_deviations_that_are_asked_for_and_no_mean():
    imu = Imu(acceleration_noise=0.3, angular_velocity_noise=0.05, orientation_noise=0.02)
    attitude = Rotation.from_rotvec([0.4, -0.7, 1.1])
    read = readings(read_imu, imu, state(orientation=attitude.as_quat()))
    forces, rates = np.array([one.specific_force for one in read]), np.array([one.angular_velocity for one in read])
    off = (attitude.inv() * Rotation.from_quat([one.orientation for one in read])).as_rotvec()
    exact = read_imu(EXACT_IMU, PARAMETERS, state(orientation=attitude.as_quat())).specific_force
    for values, deviation in ((forces - exact, 0.3), (rates, 0.05), (off, 0.02)):
        np.testing.assert_allclose(values.std(axis=0), deviation, rtol=SCATTER)
        np.testing.assert_allclose(values.mean(axis=0), 0.0, atol=5.0 * deviation / math.sqrt(READINGS))
    np.testing.assert_allclose(
        np.linalg.norm([one.orientation for one in read], axis=1), 1.0, rtol=0.0, atol=1e-14)
    pressures = np.array(readings(read_pressure, Pressure(noise=40.0)))
    assert pressures.std() == pytest.approx(40.0, rel=SCATTER)


def test_the_orientation_is_off_in_the_axes_of_the_sensor():
    attitude, imu = Rotation.from_rotvec([0.4, -0.7, 1.1]), Imu(orientation_noise=0.3)
    off = Rotation.from_quat(read_imu(imu, PARAMETERS, state(time=2.0)).orientation)
    read = read_imu(imu, PARAMETERS, state(time=2.0, orientation=attitude.as_quat())).orientation
    np.testing.assert_allclose(read, (attitude * off).as_quat(), rtol=0.0, atol=1e-15)
    assert off.magnitude() > 0.1


def test_all_noises_are_independent_also_with_the_same_seed():
    read = readings(read_imu, Imu(seed=5))
    columns = np.hstack([
        np.array([one.specific_force for one in read]), np.array([one.angular_velocity for one in read]),
        np.array([one.orientation[:3] for one in read]),
        np.array(readings(read_pressure, Pressure(seed=5)))[:, None],
        np.array(readings(without_parameters(read_velocity), Velocity(seed=5))),
        *(np.array([part[:3] for part in parts]) for parts in zip(*readings(
            without_parameters(read_odometry), OdometryNoise(1.0, 0.01, 1.0, 1.0, seed=5)))),
    ])
    correlations = np.corrcoef(columns.T)[np.triu_indices(columns.shape[1], 1)]
    np.testing.assert_allclose(correlations, 0.0, atol=5.0 / math.sqrt(READINGS))
    after = [np.corrcoef(column[1:], column[:-1])[0, 1] for column in columns.T]
    np.testing.assert_allclose(after, 0.0, atol=5.0 / math.sqrt(READINGS))


def test_the_same_seed_reads_the_same_at_the_same_time_and_another_another():
    at = state(time=1.25)
    assert read_pressure(Pressure(seed=1), PARAMETERS, at) == read_pressure(Pressure(seed=1), PARAMETERS, at)
    np.testing.assert_array_equal(
        read_imu(Imu(seed=1), PARAMETERS, at).specific_force, read_imu(Imu(seed=1), PARAMETERS, at).specific_force)
    pressures = {read_pressure(Pressure(seed=seed), PARAMETERS, state(time=time))
                 for seed, time in itertools.product((1, 2, 10**9), (-1.0, 0.0, 1.25, 1.252))}
    assert len(pressures) == 12


@pytest.mark.filterwarnings('error')
def test_the_noise_differs_from_moment_to_moment_before_time_zero_too():
    pressures = {read_pressure(Pressure(), PARAMETERS, state(time=-0.001 * tick)) for tick in range(100)}
    assert len(pressures) == 100


def test_the_noise_is_that_of_new_generators():
    for seed, stream, moment in itertools.product((0, 1, LARGEST_SEED), (0, 2), (0, 1, 125_000, 2**40)):
        new = np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, stream, moment]))
        np.testing.assert_array_equal(gaussian_noise(seed, stream, moment, 5), new.standard_normal(5))


def test_threads_that_draw_noise_at_the_same_time_do_not_disturb_each_other():
    moments = range(2000)
    alone = [gaussian_noise(3, 1, moment, 9).tolist() for moment in moments]
    with ThreadPoolExecutor(4) as threads:
        together = threads.map(lambda moment: gaussian_noise(3, 1, moment, 9).tolist(), [*moments] * 4)
        assert list(together) == alone * 4


def test_the_error_of_the_orientation_is_a_rotation_in_the_body_frame():
    random = np.random.default_rng(1)
    for tick, noise in enumerate([0.0, 1e-5, 1e-4, 1e-3, 0.01, 1.0] * 20):
        imu, attitude = Imu(orientation_noise=noise), Rotation.from_quat(random.normal(size=4))
        at = state(time=0.01 * tick, orientation=attitude.as_quat())
        error = Rotation.from_rotvec(noise * gaussian_noise(imu.seed, IMU_STREAM, round(1e6 * at.time), 9)[6:])
        np.testing.assert_allclose(
            read_imu(imu, PARAMETERS, at).orientation, (attitude * error).as_quat(), rtol=0.0, atol=1e-15)


@pytest.mark.parametrize(
    ('surface', 'z', 'depth'), [(5.0, 0.0, 5.0), (0.0, -2.5, 2.5), (1.0, 1.0, 0.0), (0.0, 3.0, 0.0)])
def test_the_pressure_is_that_of_the_water_above_and_of_the_air(surface, z, depth):
    parameters = PARAMETERS.replace(water={'surface_height': surface})
    read = read_pressure(EXACT_PRESSURE, parameters, state(position=[7.0, 8.0, z]))
    assert read == pytest.approx(101325.0 + 1000.0 * G * depth, rel=1e-14)
    salty = dataclasses.replace(EXACT_PRESSURE, water_density=1025.0, atmospheric=90000.0)
    assert read_pressure(salty, parameters, state(position=[7.0, 8.0, z])) == pytest.approx(
        90000.0 + 1025.0 * G * depth, rel=1e-14)


def test_an_imu_off_the_center_feels_what_turning_adds_in_its_own_axes():
    spin, rise = np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, 3.0])
    of = state(twist=np.concatenate([np.zeros(3), spin]), acceleration=np.concatenate([np.zeros(3), rise]))
    arm = dataclasses.replace(EXACT_IMU, position=(0.5, 0.0, 0.1))
    np.testing.assert_allclose(  # -omega^2 r inward, alpha r along the circle
        read_imu(arm, PARAMETERS, of).specific_force, [-2.0, 1.5, G], rtol=0.0, atol=1e-14)
    on_its_side = dataclasses.replace(arm, orientation=(math.pi / 2.0, 0.0, 0.0))  # its y axis up, its z axis right
    reading = read_imu(on_its_side, PARAMETERS, of)
    np.testing.assert_allclose(reading.specific_force, [-2.0, G, -1.5], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(reading.angular_velocity, [0.0, 2.0, 0.0], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(
        Rotation.from_quat(reading.orientation).apply(reading.specific_force), [-2.0, 1.5, G], rtol=0.0, atol=1e-14)


def test_bias_and_noise_of_a_mounted_imu_are_along_its_own_axes():
    mounted = dataclasses.replace(EXACT_IMU, orientation=(0.0, 0.0, math.pi / 2.0), angular_velocity_bias=(0.1, 0., 0.))
    np.testing.assert_allclose(read_imu(mounted, PARAMETERS, state()).angular_velocity, [0.1, 0.0, 0.0], atol=1e-16)


def test_a_random_walk_has_independent_changes_whose_variance_is_their_time():
    times = [0.0, 0.01, 1.0, 3.7, 100.0, 163.84]
    walks = np.array([[random_walk(seed, 9, time, 3) for time in times] for seed in range(1500)])
    np.testing.assert_array_equal(walks[:, 0], 0.0)
    np.testing.assert_array_equal(random_walk(1, 9, -5.0, 3), 0.0)
    changes = np.diff(walks[:, 1:], axis=1)
    scatter = 5.0 / math.sqrt(2.0 * 1500)
    for change, duration in zip(changes.transpose(1, 0, 2), np.diff(times[1:])):
        np.testing.assert_allclose(change.std(axis=0), math.sqrt(duration), rtol=scatter + 0.01)  # straight in 16 ms
        np.testing.assert_allclose(change.mean(axis=0), 0.0, atol=5.0 * math.sqrt(duration / 1500))
    correlations = np.corrcoef(changes.reshape(1500, -1).T)[np.triu_indices(12, 1)]
    np.testing.assert_allclose(correlations, 0.0, atol=5.0 / math.sqrt(1500))


def test_a_random_walk_does_not_jump_and_ends_somewhere():
    fine = np.array([random_walk(2, 9, 4.0 + 1e-4 * tick, 1)[0] for tick in range(-400, 400)])
    assert np.abs(np.diff(fine)).max() < 1e-4 * 64.0 * 5.0  # of a straight line between points 1/64 s apart
    assert np.isfinite(random_walk(2, 9, 1e300, 3)).all()


def test_the_bias_of_the_imu_walks_from_where_the_robot_was_started_or_put():
    walking = dataclasses.replace(
        EXACT_IMU, acceleration_bias=(1.0, 0.0, 0.0), acceleration_bias_walk=0.1, angular_velocity_bias_walk=0.01)
    began = read_imu(walking, PARAMETERS, state(time=50.0, start_time=50.0))
    np.testing.assert_array_equal(began.specific_force, [1.0, 0.0, G])
    after = read_imu(walking, PARAMETERS, state(time=75.0, start_time=50.0))
    walk = random_walk(0, 3, 25.0, 6)
    np.testing.assert_allclose(after.specific_force, [1.0, 0.0, G] + 0.1 * walk[:3], rtol=1e-15)
    np.testing.assert_allclose(after.angular_velocity, 0.01 * walk[3:], rtol=1e-15)


def test_the_velocity_log_reads_the_velocity_over_ground_with_noise():
    of = state(twist=[0.4, -0.2, 0.1, 1.0, 2.0, 3.0])
    np.testing.assert_array_equal(read_velocity(Velocity(noise=0.0), of), [0.4, -0.2, 0.1])
    read = np.array(readings(without_parameters(read_velocity), Velocity(noise=0.05), of))
    np.testing.assert_allclose(read.std(axis=0), 0.05, rtol=SCATTER)
    np.testing.assert_allclose(read.mean(axis=0), [0.4, -0.2, 0.1], atol=5.0 * 0.05 / math.sqrt(READINGS))


@pytest.mark.parametrize(('dropout', 'missing'), [(0.0, 0.0), (0.3, 0.3), (1.0, 1.0)])
def test_readings_of_the_velocity_are_missing_with_the_probability_that_is_asked_for(dropout, missing):
    read = readings(without_parameters(read_velocity), Velocity(dropout=dropout))
    share = sum(reading is None for reading in read) / READINGS
    assert share == pytest.approx(missing, abs=5.0 * math.sqrt(missing * (1.0 - missing) / READINGS))


def test_without_noise_the_odometry_is_the_truth_bit_for_bit():
    turned = Rotation.from_rotvec([0.4, -0.7, 1.1]).as_quat()
    of = state(position=[1.0, -0.0, 3.0], orientation=turned, twist=np.ones(6))
    for read, true in zip(read_odometry(OdometryNoise(), of), (of.position, of.orientation, of.twist)):
        assert read is true


def test_each_noise_of_the_odometry_has_its_deviation():
    of = state(orientation=Rotation.from_rotvec([0.4, -0.7, 1.1]).as_quat())
    noise = OdometryNoise(position=0.3, orientation=0.02, linear_velocity=0.05, angular_velocity=0.01)
    position, orientation, twist = map(np.array, zip(*readings(without_parameters(read_odometry), noise, of)))
    off = (Rotation.from_quat(of.orientation).inv() * Rotation.from_quat(orientation)).as_rotvec()
    for values, deviation in ((position, 0.3), (off, 0.02), (twist[:, :3], 0.05), (twist[:, 3:], 0.01)):
        np.testing.assert_allclose(values.std(axis=0), deviation, rtol=SCATTER)
        np.testing.assert_allclose(values.mean(axis=0), 0.0, atol=5.0 * deviation / math.sqrt(READINGS))
