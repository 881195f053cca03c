"""Energy, power and momentum of the whole robot from the positions and velocities of its parts, in plain NumPy.

Nothing here uses the simulator's equations. A link is two point masses at the Gauss points of its length, which have
exactly the kinetic energy, the momentum and the angular momentum of a uniform thin rod. The poses of the supports
follow from the closure of the six-link mechanism (`mechanism.support_pose`), and the motion of the rods is (38).
Components are those in F_b unless another frame is given. The first axis of a fin's arrays is the chain, and the second
is the time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from evidence.references.mechanism import OUTWARD, added_mass_forces, drag_forces, support_pose
from manta_sim_ros.dynamics import FinCommand, FloatArray, Parameters, Simulator

GAUSS_POINTS = 0.5 + np.array([-0.5, 0.5]) / math.sqrt(3.0)  # in link lengths from the link's root
MIDPOINT, ENDS = np.array([0.5]), np.array([0.0, 1.0])

Commands = tuple[FinCommand, FinCommand]


class Supports(NamedTuple):
    """Pose of F_0 in F_b of both supports, and its time derivative, at T times."""

    rotation: FloatArray  # (T, 2, 3, 3)
    rotation_dot: FloatArray  # (T, 2, 3, 3) [1/s]
    position: FloatArray  # (T, 2, 3) [m]
    position_dot: FloatArray  # (T, 2, 3) [m/s]


class History(NamedTuple):
    """States at T times, with fields as in `State`, and the supports at these times."""

    time: FloatArray  # (T,) [s]
    position: FloatArray  # (T, 3) [m], world
    orientation: FloatArray  # (T, 4)
    twist: FloatArray  # (T, 6) [m/s, rad/s]
    joint_angles: FloatArray  # (T, 2, n, m) [rad]
    joint_rates: FloatArray  # (T, 2, n, m) [rad/s]
    fin_wrenches: FloatArray  # (T, 2, 6) [N, N m]
    supports: Supports


class FinMotion(NamedTuple):
    """Points of one fin's links: positions [m] and inertial velocities [m/s], (n, T, m, points, 3), components in F_b.

    `relative_twist` (T, 6) is that of the support relative to the body, about the body's center of mass.
    """

    positions: FloatArray
    velocities: FloatArray
    relative_twist: FloatArray


def rods_of(parameters: Parameters, command: FinCommand, time: FloatArray) -> FloatArray:
    """Return (T, 2, 3) [front or rear; angle, rate or acceleration] [rad, s] of the rods, (38) from time 0 on."""
    rods, psi_dot = parameters.rods, 2.0 * math.pi * command.frequency
    front = math.asin(rods.rear_radius / rods.front_radius * math.sin(command.amplitude))
    motion = []
    for amplitude, phase, bias in (front, command.phase, command.front_bias), (command.amplitude, 0, command.rear_bias):
        sine, cosine = np.sin(psi_dot * time + phase), np.cos(psi_dot * time + phase)
        motion.append([amplitude * sine + bias, amplitude * psi_dot * cosine, -amplitude * psi_dot**2 * sine])
    return np.moveaxis(np.array(motion), 2, 0)


def supports_of(parameters: Parameters, commands: Commands, time: FloatArray) -> Supports:
    """Return the motion of both supports, from the closure of the mechanism and (38)."""
    sides = []
    for side, command in enumerate(commands):
        poses = [support_pose(parameters, side, rods) for rods in rods_of(parameters, command, time)]
        sides.append([np.array([getattr(pose[part], name) for pose in poses])
                      for part in range(2) for name in ('value', 'first')])
    return Supports(*(np.stack(pair, axis=1) for pair in zip(*sides, strict=True)))


def recorded(simulator: Simulator, commands: Commands, duration: float, every: int = 1) -> History:
    """Advance by `duration` [s] and return the history: the first state, and then one state every `every` steps.

    `commands` are the gaits that were commanded at time 0, with `rods.command_time_constant` 0.
    """
    parameters = simulator.parameters
    interval = every * parameters.solver.time_step
    states = [simulator.state]
    for _ in range(round(duration / interval)):
        states.append(simulator.advance(interval))
    fields = {name: np.array([getattr(state, name) for state in states]) for name in History._fields[:-1]}
    return History(**fields, supports=supports_of(parameters, commands, fields['time']))


def fin_motion(parameters: Parameters, history: History, side: int, fractions: FloatArray) -> FinMotion:
    """Return position and velocity of the points at `fractions` of each link's length, from its root."""
    fin, length, outward = parameters.fin, parameters.rods.support_length, OUTWARD[side]
    link = fin.span / fin.links
    rotation, rotation_dot, origin, origin_dot = (of_both[:, side] for of_both in history.supports)

    angles = np.moveaxis(np.cumsum(history.joint_angles[:, side], axis=-1), 1, 0)  # (n, T, m)
    rates = np.moveaxis(np.cumsum(history.joint_rates[:, side], axis=-1), 1, 0)
    zeros = np.zeros_like(angles)
    along = link * np.stack([zeros, outward * np.cos(angles), np.sin(angles)], axis=-1)
    along_dot = link * rates[..., None] * np.stack([zeros, -outward * np.sin(angles), np.cos(angles)], axis=-1)
    station = (fin.chains - np.arange(fin.chains) - 0.5) * length / fin.chains
    root = np.cumsum(along, axis=2) - along + station[:, None, None, None] * [1.0, 0.0, 0.0]
    root_dot = np.cumsum(along_dot, axis=2) - along_dot
    local = root[..., None, :] + fractions[:, None] * along[..., None, :]
    local_dot = root_dot[..., None, :] + fractions[:, None] * along_dot[..., None, :]

    def to_body(matrix: FloatArray, vectors: FloatArray) -> FloatArray:
        return np.einsum('tab,ntmpb->ntmpa', matrix, vectors)

    positions = origin[:, None, None] + to_body(rotation, local)
    relative = origin_dot[:, None, None] + to_body(rotation_dot, local) + to_body(rotation, local_dot)
    velocity, omega = history.twist[:, None, None, :3], history.twist[:, None, None, 3:]
    spin = np.einsum('tab,tcb->tac', rotation_dot, rotation)  # of the support relative to the body, as a matrix
    omega_0 = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
    twist_0 = np.concatenate([origin_dot - np.cross(omega_0, origin), omega_0], axis=-1)
    return FinMotion(positions, velocity + np.cross(omega, positions) + relative, twist_0)


def _chord(parameters: Parameters) -> float:
    """Return ds [m], each chain's share of the chord."""
    return parameters.rods.support_length / parameters.fin.chains


def _point_mass(parameters: Parameters) -> float:
    """Return half the mass of a link [kg]."""
    fin = parameters.fin
    return 0.5 * fin.density * fin.thickness * fin.span / fin.links * _chord(parameters)


def to_world(history: History) -> FloatArray:
    """Return the rotations (T, 3, 3) from F_b to the world."""
    return Rotation.from_quat(history.orientation).as_matrix()


def energy(parameters: Parameters, history: History) -> dict[str, FloatArray]:
    """Return (T,) [J] each: `kinetic` energy of body and links, `elastic` energy (13), energy of `buoyancy` (35).

    Beyond the paper, the kinetic energy includes that of the water around the body, the elastic energy that of the
    twist of the fins along the chord, and the energy of buoyancy that of the net buoyancy.
    """
    body, fin = parameters.body, parameters.fin
    rotations = to_world(history)
    inertia = np.array([body.mass] * 3 + list(body.inertia))
    kinetic = 0.5 * np.sum(inertia * history.twist**2, axis=1)
    for side in range(2):
        velocities = fin_motion(parameters, history, side, GAUSS_POINTS).velocities
        kinetic = kinetic + 0.5 * _point_mass(parameters) * np.sum(velocities**2, axis=(0, 2, 3, 4))
    relative, added_mass = relative_twist(parameters, history), np.array(body.added_mass)
    current = history.twist - relative
    # in a current, the work of the momentum of the added mass is not that of its energy alone
    kinetic = kinetic + np.sum(added_mass * relative * (0.5 * relative + current), axis=1)
    link = fin.span / fin.links
    curvature = 2.0 * np.tan(0.5 * history.joint_angles) / link
    bending_stiffness = fin.youngs_modulus * fin.thickness**3 / 12.0
    elastic = 0.5 * bending_stiffness * link * _chord(parameters) * np.sum(curvature**2, axis=(1, 2, 3))
    height = rotations[:, 2] @ np.array(body.buoyancy_center)
    lifted = body.net_buoyancy * (history.position[:, 2] + height)
    twisted = 0.5 * fin.shear_modulus * fin.thickness**3 / 3.0 * _twist(parameters, history.joint_angles)
    return {
        'kinetic': kinetic,
        'elastic': elastic + twisted,
        'buoyancy': -body.mass * body.gravity * height - lifted,
    }


def relative_twist(parameters: Parameters, history: History) -> FloatArray:
    """Return the twist of the body relative to the water (T, 6), in F_b."""
    current = np.einsum('tba,b->ta', to_world(history), np.array(parameters.water.current))
    return history.twist - np.concatenate([current, np.zeros_like(current)], axis=1)


def _twist(parameters: Parameters, joints: FloatArray) -> FloatArray:
    """Return the squared differences of the links' angles (or rates) along the chord, times dl / ds, of both fins.

    `joints` is (T, 2, n, m); the result is (T,). The links of one row are a strip of the width dl, which is twisted by
    the difference over the length ds.
    """
    differences = np.diff(np.cumsum(joints, axis=3), axis=2)
    return np.sum(differences**2, axis=(1, 2, 3)) * parameters.fin.span / parameters.fin.links / _chord(parameters)


def power(parameters: Parameters, history: History) -> dict[str, FloatArray]:
    """Return (T,) [W] each: the power on the robot of `rods`, `drag` of fins and body, `added mass` and `dampers`.

    The rods move the supports relative to the body against the fins' wrenches: their power is -wrench . relative twist.
    `drag` includes the linear and the quadratic damping of the body, `dampers` that of the twist of the fins.
    """
    body, fin, water = parameters.body, parameters.fin, parameters.water
    rods, drag_on_fins, added_mass = np.zeros((3, len(history.time)))
    rotations = to_world(history)
    current = np.einsum('tba,b->ta', rotations, np.array(water.current))
    for side in range(2):
        ends = fin_motion(parameters, history, side, ENDS)
        middle = fin_motion(parameters, history, side, MIDPOINT).velocities[..., 0, :]
        forces = drag_forces(
            parameters, ends.positions[..., 0, :], ends.positions[..., 1, :], middle - current[:, None])
        drag_on_fins += _chord(parameters) * np.sum(forces * middle, axis=(0, 2, 3))
        if water.added_mass_coefficient > 0.0:
            in_world = np.einsum('tab,ntmb->ntma', rotations, middle)
            spline = make_interp_spline(history.time, in_world, k=5, axis=1)
            accelerations = np.einsum('tba,ntmb->ntma', rotations, spline.derivative()(history.time))
            forces = added_mass_forces(
                parameters, ends.positions[..., 0, :], ends.positions[..., 1, :], accelerations)
            added_mass += _chord(parameters) * np.sum(forces * middle, axis=(0, 2, 3))
        rods -= np.sum(history.fin_wrenches[:, side] * ends.relative_twist, axis=1)
    relative = relative_twist(parameters, history)
    relative_velocity = relative[:, :3]
    resistance = np.array(body.linear_damping) + np.array(body.quadratic_damping) * np.abs(relative)
    speed = np.linalg.norm(relative_velocity, axis=1, keepdims=True)
    area = np.multiply(body.drag_area, body.drag_coefficient)
    drag = -0.5 * water.density * area * speed * relative_velocity
    joints = -fin.joint_damping * _chord(parameters) * np.sum(history.joint_rates**2, axis=(1, 2, 3))
    joints = joints - fin.twist_damping * _twist(parameters, history.joint_rates)
    return {
        'rods': rods,
        'drag': (drag_on_fins + np.sum(drag * history.twist[:, :3], axis=1)
                 - np.sum(resistance * relative * history.twist, axis=1)),
        'added mass': added_mass,
        'dampers': joints - np.sum(np.array(body.angular_damping) * history.twist[:, 3:] ** 2, axis=1),
    }


def momentum(parameters: Parameters, history: History) -> FloatArray:
    """Return the linear and angular momentum (T, 6) [N s, N m s] of the robot about the origin, world frame.

    It includes the impulse of the water around the body, its added mass.
    """
    body, rotations = parameters.body, to_world(history)
    impulse = np.array(body.added_mass) * relative_twist(parameters, history)
    linear = body.mass * history.twist[:, :3] + impulse[:, :3]
    angular = np.array(body.inertia) * history.twist[:, 3:] + impulse[:, 3:]  # about the center of mass
    for side in range(2):
        points = fin_motion(parameters, history, side, GAUSS_POINTS)
        linear = linear + _point_mass(parameters) * np.sum(points.velocities, axis=(0, 2, 3))
        angular = angular + _point_mass(parameters) * np.sum(
            np.cross(points.positions, points.velocities), axis=(0, 2, 3))
    linear, angular = (np.einsum('tab,tb->ta', rotations, vector) for vector in (linear, angular))
    return np.concatenate([linear, angular + np.cross(history.position, linear)], axis=1)


def without_smoothing(parameters: Parameters) -> Parameters:
    """Return parameters with which commands take effect at once, as in (38)."""
    return parameters.replace(rods={'command_time_constant': 0.0})
