"""The sensors read the truth of a state with their bias and noise, and nothing else."""

import dataclasses
import itertools
import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from evidence.scenarios import SWIM, TURN, sized
from manta_sim_ros.dynamics import LARGEST_SEED, MONOLITHIC, SEQUENTIAL, Simulator, State, gaussian_noise
from manta_sim_ros.sensors import IMU_STREAM, Imu, Pressure, read_imu, read_pressure

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
