"""How fast a gait moves the links through the water, by harmonic balance, without simulating it.

The first harmonic of fins and body is found, linearized about straight chains and rods at 0. Drag (12) is replaced by
the linear damping that does the same work over a cycle; its amplitude is found by iteration.

Letters: M, C, K per unit chord; J from joint rates to the normal velocities of link midpoints; B from the body's twist
to those. Arrays of both fins are [side, station, link].
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from manta_sim_ros.dynamics._kernels.constants import constants
from manta_sim_ros.dynamics.command import FinCommand
from manta_sim_ros.dynamics.parameters import Parameters
from manta_sim_ros.dynamics.quantity import FloatArray

STATIONS = 4
"""Number of chords of each fin that are evaluated, by the midpoint rule: drag varies slowly from chord to chord."""

ITERATIONS = 6
"""Iterations of the harmonic balance: each halves the distance to the limit of the speeds."""

STEEPEST_BEND = 1.5
"""Joint angle [rad] up to which the increase of the stiffness by (14) is taken into account."""

SLOWEST = 1e-6
"""Angular frequency [rad/s] below which a gait counts as rest."""

SAME_WORK = 8.0 / (3.0 * math.pi)
"""Linear damping, per amplitude of V, that does the same work in a cycle as |V| V."""


class StraightFins(NamedTuple):
    """Both fins with straight chains, rods at 0."""

    normal: FloatArray  # J (m, m) [m]
    inertia: FloatArray  # M (m, m) [kg m]
    damping: FloatArray  # c (m, m) [N s]
    stiffness: float  # K of each joint, EI / dl [N]
    twist: FloatArray  # L^T L (m, m), of joint angles: squares of the links' angles
    twist_stiffness: float  # G h^3 dl / (3 ds^2) of two chains that turn against each other [N]
    twist_damping: float  # c_t dl / ds^2 [N s]
    drag: float  # rho C_D dl / 2 [kg/m^2]
    mass: float  # of a link along its normal, added mass included [kg/m]
    chord: float  # length of the support that a station represents [m]
    station: FloatArray  # (stations,) from A, as a share of the support
    body: FloatArray  # B (2, stations, m, 6)
    coupling: FloatArray  # inertia between joints and twist (stations, m, 6) [kg, kg m]
    rigid: FloatArray  # inertia of both fins, their joints held (6, 6)


@functools.lru_cache(maxsize=16)
def straight_fins(parameters: Parameters) -> StraightFins:
    """Return the constants of both fins with straight chains, rods at 0."""
    fin, links = constants(parameters).fin, parameters.fin.links
    dl, link_mass, added = fin.link_length, fin.link_mass, fin.added_mass
    roots = dl * np.arange(links, dtype=np.float64)
    middles, sums = roots + 0.5 * dl, np.tri(links)
    offset = dl / math.sqrt(12.0)
    halves = np.concatenate([middles - offset, middles + offset])  # a thin rod as two points
    normal, halves_normal = (np.maximum(0.0, points[:, None] - roots) for points in (middles, halves))
    inertia = 0.5 * link_mass * halves_normal.T @ halves_normal + added * normal.T @ normal
    station, chord = (np.arange(STATIONS) + 0.5) / STATIONS, parameters.rods.support_length / STATIONS
    motion, halves_motion = _point_motion(parameters, station, middles), _point_motion(parameters, station, halves)
    body = motion[..., 2, :]
    return StraightFins(
        normal=normal, inertia=inertia, damping=fin.damping * np.eye(links), stiffness=0.5 * fin.stiffness,
        twist=sums.T @ sums, twist_stiffness=fin.twist_stiffness, twist_damping=fin.twist_damping,
        drag=fin.drag, mass=link_mass + added, chord=chord, station=station, body=body,
        coupling=0.5 * link_mass * halves_normal.T @ halves_motion[0, ..., 2, :] + added * normal.T @ body[0],
        rigid=chord * (
            0.5 * link_mass * np.einsum('fspxa,fspxb->ab', halves_motion, halves_motion)
            + added * np.einsum('fspa,fspb->ab', body, body)),
    )


def body_inertia(parameters: Parameters) -> FloatArray:
    """Return the inertia (6,) [kg, kg m^2] of the body with its added mass."""
    body = parameters.body
    return np.array((body.mass,) * 3 + body.inertia) + body.added_mass


def body_damping(parameters: Parameters, speeds: FloatArray) -> FloatArray:
    """Return the slope (6,) [N s/m, N m s] of the body's damping at speeds (6,) [m/s, rad/s], without drag (34)."""
    body = parameters.body
    return np.add(body.linear_damping, (0.0, 0.0, 0.0, *body.angular_damping)) + 2.0 * speeds * body.quadratic_damping


def _point_motion(parameters: Parameters, station: FloatArray, span: FloatArray) -> FloatArray:
    """Return the velocities (2, stations, points, 3, 6) by the twist of points that are `span` [m] from the roots."""
    rods = parameters.rods
    sine = (rods.front_radius - rods.rear_radius) / rods.support_length  # of theta, (8), rods at 0
    cosine = math.sqrt(1.0 - sine * sine)
    along = station[:, None] * rods.support_length
    x = rods.rear_motor_position[0] + cosine * along - sine * span
    y = rods.rear_motor_position[1] + rods.rear_radius + sine * along + cosine * span
    z = rods.rear_motor_position[2]
    motion = np.zeros((2, *x.shape, 3, 6))
    motion[..., range(3), range(3)] = 1.0
    motion[..., 0, 4], motion[..., 1, 3] = z, -z
    motion[..., 1, 5], motion[..., 2, 4] = x, -x
    for side, lateral in enumerate((y, -y)):
        motion[side, ..., 0, 5], motion[side, ..., 2, 3] = -lateral, lateral
    return motion


def gait_motion(
    parameters: Parameters, fins: StraightFins, commands: tuple[FinCommand, FinCommand],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return amplitudes of normal speeds [m/s] and joint angles [rad] of a chain (m,), and of the body's twist (6,).

    The first two are the largest of all chains. Harmonic balance of fins and body, driven by the heave of the supports
    at the frequency of each fin.
    """
    body, m = parameters.body, parameters.fin.links
    J, B = fins.normal, fins.body
    driven = _support_heave(parameters, fins, commands)
    speeds = sum((0.5 * np.abs(drive) for drive in driven.values()), np.zeros(B.shape[:3]))
    angles, twist = np.zeros(B.shape[:3]), np.zeros(6)
    own = body_inertia(parameters)
    righting = (body.mass * body.gravity + body.net_buoyancy) * body.buoyancy_center[2]
    drag_of_body = SAME_WORK * np.array(body.quadratic_damping)
    drag_of_body[2] += 0.5 * SAME_WORK * parameters.water.density * body.drag_area[2] * body.drag_coefficient[2]
    for _ in range(ITERATIONS):
        drag = SAME_WORK * fins.drag * speeds
        half = np.tan(0.5 * np.minimum(angles, STEEPEST_BEND))
        stiffness = fins.stiffness * (1.0 + half * half)  # (14), nearly its secant
        damping = fins.damping + J.T @ (drag[..., None] * J)
        squares, twist_squares = np.zeros((2, *B.shape[:3])), np.zeros(6)
        for frequency, drive in driven.items():
            resistance = (drag + 1j * frequency * fins.mass)[..., None]
            joints = damping + 1j * frequency * fins.inertia
            joints[..., range(m), range(m)] -= 1j * stiffness / frequency
            moved = drive[..., None]
            if not parameters.solver.fixed_base:
                moved = np.concatenate((moved, B), axis=-1)
            rates = -np.linalg.solve(joints, J.T @ (resistance * moved))
            normal = moved + J @ rates
            motions = np.ones(1, dtype=complex)
            if not parameters.solver.fixed_base:
                forces = fins.chord * np.tensordot(B, resistance * normal, axes=((0, 1, 2), (0, 1, 2)))
                rigid = 1j * frequency * np.diag(own) + np.diag(body.linear_damping + drag_of_body * twist)
                for axis in (3, 4):
                    rigid[axis, axis] += body.angular_damping[axis - 3] + righting / (1j * frequency)
                motions = np.append(1.0, -np.linalg.solve(rigid + forces[:, 1:], forces[:, 0]))
                twist_squares += np.abs(motions[1:]) ** 2
            squares[0] += np.abs(normal @ motions) ** 2
            squares[1] += np.abs(rates @ motions / frequency) ** 2
        amplitudes = np.sqrt(squares)
        speeds, angles = 0.5 * (speeds + amplitudes[0]), 0.5 * (angles + amplitudes[1])
        twist = 0.5 * (twist + np.sqrt(twist_squares))
    return speeds.max(axis=(0, 1)), angles.max(axis=(0, 1)), twist


def _support_heave(
    parameters: Parameters, fins: StraightFins, commands: tuple[FinCommand, FinCommand],
) -> dict[float, FloatArray]:
    """Return the first harmonic of the supports' heave rate (2, stations, m) [m/s] by angular frequency [rad/s]."""
    rods = parameters.rods
    driven: dict[float, FloatArray] = {}
    for side, command in enumerate(commands):
        frequency = 2.0 * math.pi * command.frequency
        if frequency < SLOWEST or command.amplitude == 0.0:
            continue
        front = math.asin(min(1.0, rods.rear_radius / rods.front_radius * math.sin(command.amplitude)))
        rear_rate, front_rate = (  # sin(A sin(psi)) has the first harmonic 2 J_1(A), here to third order in A
            radius * frequency * amplitude * (1.0 - amplitude**2 / 8.0)
            for radius, amplitude in ((rods.rear_radius, command.amplitude), (rods.front_radius, front)))
        heave = driven.setdefault(frequency, np.zeros(fins.body.shape[:3], dtype=complex))
        heave[side] = (rear_rate + fins.station * (front_rate * np.exp(1j * command.phase) - rear_rate))[:, None]
    return driven


def flow_motion(parameters: Parameters, fins: StraightFins) -> tuple[FloatArray, FloatArray]:
    """Return the normal speeds (m,) [m/s] due to the current, and the joint angles (m,) [rad] of a chain that it bends.

    The more a fin bends, the less a vertical current acts on it, and the more a horizontal one. A free body drifts with
    the horizontal current.
    """
    current = parameters.water.current
    vertical = abs(current[2])
    horizontal = math.hypot(current[0], current[1]) if parameters.solver.fixed_base else 0.0
    angles = np.zeros(len(fins.normal))
    for _ in range(3 * ITERATIONS if vertical + horizontal > 0.0 else 0):
        facing = np.cos(np.minimum(np.cumsum(angles), STEEPEST_BEND))
        torque = fins.normal.T @ (fins.drag * (vertical**2 + horizontal**2) * facing**2)
        angles = 0.5 * (angles + np.minimum(torque, STEEPEST_BEND * fins.stiffness) / max(fins.stiffness, 1e-9))
    bent = np.minimum(np.cumsum(angles), STEEPEST_BEND)
    return vertical * np.cos(bent) + horizontal * np.sin(bent), angles
