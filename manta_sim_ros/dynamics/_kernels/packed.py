"""The staggered coupling of several robots at once: the chains of all their fins side by side in the same rows.

Vector units then run across robots: chain k of fin i is number k * LANES + i of a row. The physics is that of the
kernels of one robot, compiled again for rows of values where one robot has one value. Their results differ by rounding.
Lane i is the left fin of robot i, or the right fin of robot i - ROBOTS.
"""

from __future__ import annotations

from math import floor, pi, sqrt
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core.registry import CPUDispatcher

from manta_sim_ros.dynamics._kernels import actuation, fin, gait, geometry, runge_kutta
from manta_sim_ros.dynamics._kernels.actuation import BodyMotion, SupportMotion, body_motion
from manta_sim_ros.dynamics._kernels.compilation import KERNEL_OPTIONS, entry_kernel, kernel
from manta_sim_ros.dynamics._kernels.constants import BodyConstants, Constants, FinConstants, RodConstants
from manta_sim_ros.dynamics._kernels.fin import SupportAcceleration, sine_cosine
from manta_sim_ros.dynamics._kernels.gait import Gait, Rod, advance_gait
from manta_sim_ros.dynamics._kernels.geometry import Wrench, mirror_polar, rotation_of, vector_at
from manta_sim_ros.dynamics._kernels.inputs import Inputs
from manta_sim_ros.dynamics._kernels.layout import (
    Chains,
    Links,
    Workspace,
    aligned_zeros,
    chains_of,
    links_of,
    packed_workspace,
)
from manta_sim_ros.dynamics._kernels.motion import Motion, diverged_chain, gait_of, store_rods, store_wrench
from manta_sim_ros.dynamics._kernels.runge_kutta import NODES, STAGES
from manta_sim_ros.dynamics._kernels.staggered import step_body
from manta_sim_ros.dynamics._kernels.waterline import deep
from manta_sim_ros.dynamics.quantity import FloatArray, Vector

Arrays = tuple[FloatArray, FloatArray, FloatArray]
"""The components of vectors."""

ROBOTS = 8
"""Robots that are simulated together."""

LANES = 2 * ROBOTS
"""Their fins."""


@kernel
def at(values: FloatArray, k: int) -> float:
    """Return the value of number k of a row."""
    return values[k]


@kernel
def vector_of(rows: Arrays, k: int) -> Vector:
    """Return the vector of number k of three rows."""
    return rows[0][k], rows[1][k], rows[2][k]


PI_1, PI_2 = 3.14159265346825122834, 1.21542010130123844986e-10
"""pi in two parts, after Cody and Waite: the first has 33 bits, so that its product with a small integer is exact."""


@kernel
def sine(x: float) -> float:
    """Return sin x, |x| below 1e4, to rounding, in arithmetic that runs in vector units."""
    turns = floor(x / pi + 0.5)
    half, _ = sine_cosine((x - turns * PI_1) - turns * PI_2)
    return half if turns - 2.0 * floor(0.5 * turns) == 0.0 else -half


@kernel
def cosine(x: float) -> float:
    """Return cos x, as `sine`."""
    turns = floor(x / pi + 0.5)
    _, half = sine_cosine((x - turns * PI_1) - turns * PI_2)
    return half if turns - 2.0 * floor(0.5 * turns) == 0.0 else -half


# The rational approximation of asin in Sun's fdlibm, for |x| <= 1/2.
P0, P1, P2, P3, P4, P5 = (
    1.66666666666666657415e-01, -3.25565818622400915405e-01, 2.01212532134862925881e-01, -4.00555345006794114027e-02,
    7.91534994289814532176e-04, 3.47933107596021167570e-05)
Q1, Q2, Q3, Q4 = (
    -2.40339491173441421878e+00, 2.02094576023350569471e+00, -6.88283971605453293030e-01, 7.70381505559019352791e-02)


@kernel
def arcsine(x: float) -> float:
    """Return asin x to rounding; beyond 1/2 it is pi / 2 - 2 asin sqrt((1 - x) / 2)."""
    size = abs(x)
    square = x * x if size < 0.5 else 0.5 * (1.0 - size)
    root = size if size < 0.5 else sqrt(square)
    above = square * (P0 + square * (P1 + square * (P2 + square * (P3 + square * (P4 + square * P5)))))
    below = 1.0 + square * (Q1 + square * (Q2 + square * (Q3 + square * Q4)))
    angle = root + root * (above / below)
    angle = angle if size < 0.5 else 0.5 * pi - 2.0 * angle
    return angle if x > 0.0 else -angle


def _compiled_again(*modules: ModuleType, **others: Any) -> SimpleNamespace:
    """Return the kernels of modules, which import from one another in this order, with `others` for what they call."""
    made: dict[str, Any] = dict(others)
    for module in modules:
        for name, value in vars(module).items():
            if isinstance(value, CPUDispatcher) and value.__module__ == module.__name__ and name not in others:
                function = value.py_func
                again = FunctionType(function.__code__, {**function.__globals__, **made}, name)
                made[name] = numba.njit(**{**KERNEL_OPTIONS, 'fastmath': {'contract'}})(again)
    return SimpleNamespace(**made)


_wide = _compiled_again(
    geometry, gait, actuation, fin, runge_kutta,
    LANES=LANES, at=at, vector_of=vector_of, sin=sine, cos=cosine, asin=arcsine)

acceleration_bending, force_along_support, root_force = (
    _wide.acceleration_bending, _wide.force_along_support, _wide.root_force)
add_twist_torques, surface_slopes, water_loads = _wide.add_twist_torques, _wide.surface_slopes, _wide.water_loads
articulated_inertia, joint_accelerations, link_motion = (
    _wide.articulated_inertia, _wide.joint_accelerations, _wide.link_motion)
begin_joints, end_joints, next_stage_of_joints = _wide.begin_joints, _wide.end_joints, _wide.next_stage_of_joints
rod_motion, rotate_back, wrench_on_body = _wide.rod_motion, _wide.rotate_back, _wide.wrench_on_body
support_acceleration, support_motion = _wide.support_acceleration, _wide.support_motion


class Lanes(NamedTuple):
    """What the fins have: the tuples of one fin, with an array (LANES,) where that has a number."""

    rods: Any  # RodConstants
    gait: Any  # Gait, with tuples of five arrays
    body: Any  # BodyMotion
    current: Arrays  # in F_b, mirrored on the right
    front: Any  # Rod
    rear: Any
    support: Any  # SupportMotion, whose velocity is that to the water
    acceleration: Any  # SupportAcceleration
    bending: tuple[FloatArray, FloatArray]
    wrench: Any  # Wrench on the support


class Rows(NamedTuple):
    """What the chains of a fin share, in rows."""

    fin: Any  # FinConstants
    velocity: Arrays  # of A to the water, in F_0
    omega: Arrays
    roll_acceleration: FloatArray
    acceleration: Any  # SupportAcceleration
    bending: tuple[FloatArray, FloatArray]
    force: Arrays  # of each chain on the support
    moment: Arrays
    zeros: FloatArray


class Tables(NamedTuple):
    """The rows of `Rows` that change, as [chain, lane]."""

    velocity: Arrays
    omega: Arrays
    at_a: Arrays
    slope: Arrays
    roll_acceleration: FloatArray
    bending: tuple[FloatArray, FloatArray]
    force: Arrays
    moment: Arrays


class Bodies(NamedTuple):
    """What the bodies have, [robot]."""

    values: FloatArray  # (robots, values of BodyConstants)
    moves_water: bool
    current: FloatArray  # (robots, 3)
    highest: FloatArray  # (robots,), height below which no part of the robot can be out of the water [m]


class Pack(NamedTuple):
    """Robots that are simulated together."""

    lanes: Lanes
    rows: Rows
    tables: Tables
    bodies: Bodies
    motion: Motion  # [robot] in front
    work: Workspace
    time_step: float
    fixed_base: bool


class _BodyStep(NamedTuple):
    """What `step_body` needs of the constants."""

    body: BodyConstants
    time_step: float


@kernel
def _motion_of(a: Motion, robot: int) -> Motion:
    """Return the motion of one robot."""
    return Motion(
        a.position[robot], a.orientation[robot], a.twist[robot], a.acceleration[robot], a.gait[robot],
        a.gait_rates[robot], a.gait_commands[robot], a.cycle_angles[robot], a.rod_angles[robot], a.fin_wrenches[robot],
        a.rod_rates[robot], a.rod_torques[robot], a.joint_angles[robot], a.joint_rates[robot])


@kernel
def _body_of(bodies: Bodies, robot: int) -> BodyConstants:
    """Return the constants of the body of one robot."""
    a = bodies.values[robot]
    return BodyConstants(
        a[0], (a[1], a[2], a[3]), (a[4], a[5], a[6]), (a[7], a[8], a[9]), (a[10], a[11], a[12]), a[13],
        bodies.moves_water, (a[14], a[15], a[16], a[17], a[18], a[19]), (a[20], a[21], a[22], a[23], a[24], a[25]),
        (a[26], a[27], a[28], a[29], a[30], a[31]), a[32], 0.0, a[33])


@kernel
def _put(vector: Vector, rows: Arrays, k: int) -> None:
    """Put a vector into number k of three rows."""
    rows[0][k], rows[1][k], rows[2][k] = vector


@kernel
def _put_five(values: FloatArray, rows: tuple[FloatArray, ...], k: int) -> None:
    rows[0][k], rows[1][k], rows[2][k], rows[3][k], rows[4][k] = values[0], values[1], values[2], values[3], values[4]


@kernel
def _rods_of(rods: Any, k: int) -> RodConstants:
    """Return the constants of the rods of lane k, which follow gaits."""
    return RodConstants(
        rods.front_radius[k], rods.rear_radius[k], rods.support_length[k], vector_of(rods.motor_position, k),
        rods.time_constant[k], False, 1.0, 1.0, 1.0)


@kernel
def _five(values: tuple[FloatArray, ...], k: int) -> tuple[float, ...]:
    """Return number k of five rows."""
    return values[0][k], values[1][k], values[2][k], values[3][k], values[4][k]


@kernel
def _rod(rod: Any, k: int) -> Rod:
    """Return the motion of the rod of lane k."""
    return Rod(rod.angle[k], rod.angle_dot[k], rod.angle_ddot[k])


@kernel
def _load_lanes(motion: Motion, bodies: Bodies, lanes: Lanes) -> None:
    """Lay out what the fins see of the bodies, and their gaits."""
    body, gait = lanes.body, lanes.gait
    for robot in range(ROBOTS):
        one = _motion_of(motion, robot)
        current = rotate_back(rotation_of(one.orientation), vector_at(bodies.current[robot], 0))
        for side in range(2):
            i = side * ROBOTS + robot
            seen = body_motion(side, one.twist, one.acceleration)
            _put(seen.velocity, body.velocity, i)
            _put(seen.omega, body.omega, i)
            _put(seen.velocity_dot, body.velocity_dot, i)
            _put(seen.omega_dot, body.omega_dot, i)
            _put(mirror_polar(current, side), lanes.current, i)
            _put_five(one.gait[side], gait.value, i)
            _put_five(one.gait_rates[side], gait.rate, i)
            gait.cycle_angle[i] = one.cycle_angles[side]


@kernel
def _move_rods(lanes: Lanes, elapsed: float) -> None:
    """Find the motion of the rods, `elapsed` [s] after the gaits were as they are."""
    gait, front, rear = lanes.gait, lanes.front, lanes.rear
    for i in range(LANES):
        one = Gait(_five(gait.value, i), _five(gait.rate, i), _five(gait.command, i), gait.cycle_angle[i])
        a, b = rod_motion(_rods_of(lanes.rods, i), one, elapsed)
        front.angle[i], front.angle_dot[i], front.angle_ddot[i] = a.angle, a.angle_dot, a.angle_ddot
        rear.angle[i], rear.angle_dot[i], rear.angle_ddot[i] = b.angle, b.angle_dot, b.angle_ddot


@kernel
def _move_supports(lanes: Lanes) -> None:
    """Find the motion of the supports."""
    body, out = lanes.body, lanes.support
    for i in range(LANES):
        seen = BodyMotion(
            vector_of(body.velocity, i), vector_of(body.omega, i), vector_of(body.velocity_dot, i),
            vector_of(body.omega_dot, i))
        support = support_motion(_rods_of(lanes.rods, i), _rod(lanes.front, i), _rod(lanes.rear, i), seen)
        _put(support.rotation[0], out.rotation[0], i)
        _put(support.rotation[1], out.rotation[1], i)
        _put(support.rotation[2], out.rotation[2], i)
        _put(support.position, out.position, i)
        current = rotate_back(support.rotation, vector_of(lanes.current, i))
        v = support.velocity
        _put((v[0] - current[0], v[1] - current[1], v[2] - current[2]), out.velocity, i)
        _put(support.omega, out.omega, i)
        _put(support.omega_dot, out.omega_dot, i)
        acceleration = support_acceleration(support)
        _put(acceleration.at_a, lanes.acceleration.at_a, i)
        _put(acceleration.slope, lanes.acceleration.slope, i)
        lanes.bending[0][i], lanes.bending[1][i] = acceleration_bending(support.omega, support.omega_dot)


@kernel
def _share(lanes: Lanes, tables: Tables) -> None:
    """Copy what a fin has to its chains."""
    support, acceleration = lanes.support, lanes.acceleration
    _repeat_vector(support.velocity, tables.velocity)
    _repeat_vector(support.omega, tables.omega)
    _repeat_vector(acceleration.at_a, tables.at_a)
    _repeat_vector(acceleration.slope, tables.slope)
    _repeat(support.omega_dot[0], tables.roll_acceleration)
    _repeat(lanes.bending[0], tables.bending[0])
    _repeat(lanes.bending[1], tables.bending[1])


@kernel
def _repeat_vector(lanes: Arrays, tables: Arrays) -> None:
    _repeat(lanes[0], tables[0])  # a loop would have to look into the tuples at run time
    _repeat(lanes[1], tables[1])
    _repeat(lanes[2], tables[2])


@kernel
def _repeat(lane: FloatArray, table: FloatArray) -> None:
    """Copy the lanes to each chain."""
    for chain in range(table.shape[0]):
        for i in range(LANES):
            table[chain, i] = lane[i]


@kernel
def _find_wrenches(rows: Rows, links: Links, chains: Chains) -> None:
    """Find the wrench of each chain on the support, as `support_wrench`."""
    fin = rows.fin
    count, row = links.c.shape
    (fx, fy, fz), (mx, my, mz) = rows.force, rows.moment
    for k in range(row):
        root_fy, root_fz = root_force(fin, rows.acceleration, chains, k)
        fx[k], fy[k], fz[k], mx[k] = 0.0, -root_fy, -root_fz, -links.torque[0, k]
        my[k], mz[k] = fin.station[k] * root_fz, -fin.station[k] * root_fy
    for j in range(count):
        for k in range(row):
            force, couple_y, couple_z = force_along_support(
                fin, rows.omega, rows.bending, rows.acceleration, links, j, k)
            fx[k] -= force
            my[k] -= links.z[j, k] * force + couple_y
            mz[k] += links.y[j, k] * force + couple_z


@kernel
def _sum_chains(spacing: FloatArray, tables: Tables, wrench: Any) -> None:
    """Sum what `_find_wrenches` found over the chains of each fin."""
    force, moment = tables.force, tables.moment
    _sum(spacing, force[0], wrench.force[0])
    _sum(spacing, force[1], wrench.force[1])
    _sum(spacing, force[2], wrench.force[2])
    _sum(spacing, moment[0], wrench.moment[0])
    _sum(spacing, moment[1], wrench.moment[1])
    _sum(spacing, moment[2], wrench.moment[2])


@kernel
def _sum(spacing: FloatArray, table: FloatArray, lane: FloatArray) -> None:
    """Fill the lanes with the sums over the chains, times their spacing."""
    for i in range(LANES):
        lane[i] = 0.0
    for chain in range(table.shape[0]):
        for i in range(LANES):
            lane[i] += table[chain, i]
    for i in range(LANES):
        lane[i] *= spacing[i]


@kernel
def _store_lanes(lanes: Lanes, motion: Motion, time_step: float) -> None:
    """Store rod angles and wrenches, and move the gaits on."""
    for robot in range(ROBOTS):
        one = _motion_of(motion, robot)
        for side in range(2):
            i = side * ROBOTS + robot
            support = lanes.support
            rotation = (
                vector_of(support.rotation[0], i), vector_of(support.rotation[1], i), vector_of(support.rotation[2], i))
            none = (0.0, 0.0, 0.0)
            wrench = wrench_on_body(
                SupportMotion(rotation, vector_of(support.position, i), none, none, none, none),
                Wrench(vector_of(lanes.wrench.force, i), vector_of(lanes.wrench.moment, i)))
            store_wrench(wrench, side, one.fin_wrenches)
            one.rod_angles[side, 0], one.rod_angles[side, 1] = lanes.front.angle[i], lanes.rear.angle[i]
            one.cycle_angles[side] = advance_gait(_rods_of(lanes.rods, i), gait_of(one, side), time_step)


@kernel
def _step_body_of(pack: Pack, robot: int) -> bool:
    """Take the step of the body of one robot; return whether it is not too fast."""
    motion, none = _motion_of(pack.motion, robot), (0.0, 0.0, 0.0)
    inputs = Inputs(vector_at(pack.bodies.current[robot], 0), Wrench(none, none), Wrench(none, none))
    rotation = rotation_of(motion.orientation)
    current = rotate_back(rotation, inputs.current)
    return step_body(
        _BodyStep(_body_of(pack.bodies, robot), pack.time_step), inputs, rotation, current, deep(), motion)


@entry_kernel
def advance(pack: Pack, steps: int) -> int:
    """Take `steps` steps of all robots in place; return -1, or the robot that diverged or came near the surface."""
    lanes, rows, motion, bodies, time_step = pack.lanes, pack.rows, pack.motion, pack.bodies, pack.time_step
    links, chains, fin = links_of(pack.work, 0), chains_of(pack.work), rows.fin
    for _ in range(steps):
        for robot in range(ROBOTS):
            if motion.position[robot, 2] > bodies.highest[robot]:
                return robot
        _load_lanes(motion, bodies, lanes)
        begin_joints(links)
        for stage in range(STAGES + 1):
            if stage == 0 or NODES[stage] != NODES[stage - 1]:
                _move_rods(lanes, NODES[stage] * time_step)
                _move_supports(lanes)
                _share(lanes, pack.tables)
            link_motion(fin, links, chains)
            add_twist_torques(fin, links, chains)
            surface_slopes(fin, links)
            water_loads(fin, rows.velocity, rows.omega, links)
            articulated_inertia(fin, rows.omega, rows.roll_acceleration, links, chains)
            joint_accelerations(fin, rows.acceleration, rows.zeros, links, chains)
            if stage < STAGES:
                next_stage_of_joints(links, stage, time_step)
            if stage == STAGES - 1:
                end_joints(links)
        diverged = diverged_chain(links, links.q.shape[1])
        if diverged >= 0:
            return diverged % ROBOTS
        _find_wrenches(rows, links, chains)
        _sum_chains(fin.chain_spacing, pack.tables, lanes.wrench)
        _store_lanes(lanes, motion, time_step)
        if not pack.fixed_base:
            for robot in range(ROBOTS):
                if not _step_body_of(pack, robot):
                    return robot
    for robot in range(ROBOTS):
        one = _motion_of(motion, robot)
        store_rods(_rods_of(lanes.rods, robot), one)
    return -1


def pack_of(robots: list[tuple[Constants, FloatArray, Motion]]) -> Pack:
    """Return the pack of up to `ROBOTS` robots with as many chains and links, each with its current.

    It is filled up with copies of the last robot.
    """
    constants, currents, motions = zip(*robots, *[robots[-1]] * (ROBOTS - len(robots)), strict=True)
    motion = Motion(*(np.stack(field) for field in zip(*motions, strict=True)))
    _, _, chains, links = motion.joint_angles.shape
    fins = [each.fin for each in constants]
    values = [_by_lane([getattr(fin, name) for fin in fins]) for name in FinConstants._fields[2:]]
    station = np.stack([each.fin.station[:chains] for each in (*constants, *constants)], axis=1).ravel()
    fin: Any = FinConstants
    rows = Rows(
        fin(chains, station, *(np.tile(value, chains) for value in values)),
        velocity=_vectors(chains), omega=_vectors(chains), roll_acceleration=_arrays(1, chains)[0],
        acceleration=SupportAcceleration(_vectors(chains), _vectors(chains)), bending=_arrays(2, chains),
        force=_vectors(chains), moment=_vectors(chains), zeros=_arrays(1, chains)[0])
    bodies = Bodies(
        values=np.array([_flat(each.body) for each in constants]),
        moves_water=constants[0].body.moves_water,
        current=np.stack(currents),
        highest=np.array([each.surface_height - each.reach for each in constants]))
    pack = Pack(
        _lanes([each.rods for each in constants], motion.gait_commands), rows, _tables(rows, chains), bodies, motion,
        packed_workspace(chains * LANES, links), constants[0].time_step, constants[0].fixed_base)
    for table, joints in _joints(pack):
        table[:] = joints.transpose(3, 2, 1, 0)
    return pack


def motions_of(pack: Pack) -> list[FloatArray]:
    """Return the motion of each robot, as in `motion_of`, in new arrays."""
    for table, joints in _joints(pack):
        joints[:] = table.transpose(3, 2, 1, 0)
    values = np.concatenate([field.reshape(ROBOTS, -1) for field in pack.motion], axis=1)
    return [values[robot].copy() for robot in range(ROBOTS)]


def _joints(pack: Pack) -> list[tuple[FloatArray, FloatArray]]:
    """Return angles and rates of the joints as [link, chain, side, robot] and as [robot, side, chain, link]."""
    links, motion = links_of.py_func(pack.work, 0), pack.motion
    return [(rows.reshape(len(rows), -1, 2, ROBOTS), joints) for rows, joints in (
        (links.q, motion.joint_angles), (links.q_dot, motion.joint_rates))]


def _lanes(rods: list[RodConstants], commands: FloatArray) -> Lanes:
    """Return the lanes of robots with these rods and commands (robots, 2, 5); the rest is zero."""
    radii = (_by_lane([getattr(each, name) for each in rods]) for name in RodConstants._fields[:3])
    motors = tuple(_by_lane([each.motor_position[axis] for each in rods]) for axis in range(3))
    support = SupportMotion((_vectors(), _vectors(), _vectors()), *(_vectors() for _ in range(5)))
    constants: Any = RodConstants
    gait: Any = Gait
    return Lanes(
        rods=constants(*radii, motors, _by_lane([each.time_constant for each in rods]), False, 1.0, 1.0, 1.0),
        gait=gait(_arrays(5), _arrays(5), tuple(commands.transpose(2, 1, 0).reshape(5, LANES).copy()), _arrays(1)[0]),
        body=BodyMotion(*(_vectors() for _ in range(4))), current=_vectors(), front=Rod(*_vectors()),
        rear=Rod(*_vectors()), support=support, acceleration=SupportAcceleration(_vectors(), _vectors()),
        bending=_arrays(2), wrench=Wrench(_vectors(), _vectors()))


def _tables(rows: Rows, chains: int) -> Tables:
    """Return the rows that change as [chain, lane], in the same memory."""
    def table(row: Any) -> Any:
        return row.reshape(chains, LANES) if isinstance(row, np.ndarray) else tuple(map(table, row))

    acceleration = rows.acceleration
    return Tables(*map(table, (
        rows.velocity, rows.omega, acceleration.at_a, acceleration.slope, rows.roll_acceleration, rows.bending,
        rows.force, rows.moment)))


def _flat(body: BodyConstants) -> list[float]:
    """Return the values of a body as `_body_of` takes them."""
    values = [value for name, value in body._asdict().items() if name not in ('moves_water', 'unsupported_weight')]
    return [number for value in values for number in (value if isinstance(value, tuple) else (value,))]


def _by_lane(values: list[float]) -> FloatArray:
    """Return a value of each robot as one of each lane."""
    return np.array([*values, *values], dtype=float)


def _arrays(count: int, chains: int = 1) -> Any:
    """Return a tuple of rows of so many chains, all zero."""
    return tuple(aligned_zeros((count, chains * LANES)))


def _vectors(chains: int = 1) -> Any:
    """Return rows for the components of vectors, all zero."""
    return _arrays(3, chains)
