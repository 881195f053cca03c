"""The staggered coupling of several robots at once: the chains of all their fins side by side in the same rows.

Vector units then run across robots: chain k of fin i is number k * LANES + i of a row. The physics is that of the
kernels of one robot, compiled again for rows of values where one robot has one value. Their results differ by rounding.
Lane i is the left fin of robot i, or the right fin of robot i - ROBOTS.
"""

from __future__ import annotations

from math import floor, pi
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
from manta_sim_ros.dynamics._kernels.layout import Chains, Links, Workspace, aligned_zeros, chains_of, links_of, packed_workspace
from manta_sim_ros.dynamics._kernels.motion import Motion, diverged_chain, gait_of, store_rods, store_wrench
from manta_sim_ros.dynamics._kernels.runge_kutta import NODES, STAGES
from manta_sim_ros.dynamics._kernels.staggered import step_body
from manta_sim_ros.dynamics._kernels.waterline import deep
from manta_sim_ros.dynamics.quantity import FloatArray, Vector

ROBOTS = 4
"""Robots that are simulated together."""

LANES = 2 * ROBOTS
"""Their fins."""


@kernel
def at(values: FloatArray, k: int) -> float:
    """Return the value of number k of a row."""
    return values[k]


@kernel
def vector_of(rows: tuple[FloatArray, FloatArray, FloatArray], k: int) -> Vector:
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


def _compiled_again(*modules: ModuleType, **others: Any) -> SimpleNamespace:
    """Return the kernels of modules, which import from one another in this order, with `others` for what they call."""
    made: dict[str, Any] = dict(others)
    for module in modules:
        for name, value in vars(module).items():
            if isinstance(value, CPUDispatcher) and value.__module__ == module.__name__ and name not in others:
                function = value.py_func
                again = FunctionType(function.__code__, {**function.__globals__, **made}, name)
                made[name] = numba.njit(**KERNEL_OPTIONS, fastmath={'contract'})(again)
    return SimpleNamespace(**made)


_wide = _compiled_again(
    geometry, gait, actuation, fin, runge_kutta, LANES=LANES, at=at, vector_of=vector_of, sin=sine, cos=cosine)

articulated_inertia, joint_accelerations, link_motion = (
    _wide.articulated_inertia, _wide.joint_accelerations, _wide.link_motion)
acceleration_bending, force_along_support, root_force = (
    _wide.acceleration_bending, _wide.force_along_support, _wide.root_force)
add_twist_torques, surface_slopes, water_loads = _wide.add_twist_torques, _wide.surface_slopes, _wide.water_loads
rod_motion, support_acceleration, support_motion = (
    _wide.rod_motion, _wide.support_acceleration, _wide.support_motion)
wrench_on_body, rotate_back = _wide.wrench_on_body, _wide.rotate_back
begin_joints, end_joints, next_stage_of_joints = (
    _wide.begin_joints, _wide.end_joints, _wide.next_stage_of_joints)

class Lanes(NamedTuple):
    """What the fins have, [lane] where one fin has a number."""

    rods: RodConstants
    gait: Gait
    body: BodyMotion
    current: tuple[FloatArray, FloatArray, FloatArray]  # in F_b, mirrored on the right
    front: Rod
    rear: Rod
    support: SupportMotion  # the velocity is that to the water
    acceleration: SupportAcceleration
    bending: tuple[FloatArray, FloatArray]
    wrench: Wrench


class Rows(NamedTuple):
    """What the chains of a fin share, in rows."""

    fin: FinConstants
    velocity: tuple[FloatArray, FloatArray, FloatArray]  # of A to the water, in F_0
    omega: tuple[FloatArray, FloatArray, FloatArray]
    roll_acceleration: FloatArray
    acceleration: SupportAcceleration
    bending: tuple[FloatArray, FloatArray]
    sums: tuple[FloatArray, ...]  # of the wrench of each chain
    zeros: FloatArray


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
    tables: tuple[FloatArray, ...]  # the rows of `Rows` that change, as [chain, lane]
    bodies: Bodies
    motion: Motion  # [robot] in front
    work: Workspace
    time_step: float
    fixed_base: bool


class _BodyStep(NamedTuple):
    body: BodyConstants
    time_step: float


@kernel
def _motion_of(motion: Motion, robot: int) -> Motion:
    a = motion
    return Motion(
        a.position[robot], a.orientation[robot], a.twist[robot], a.acceleration[robot], a.joint_angles[robot],
        a.joint_rates[robot], a.gait[robot], a.gait_rates[robot], a.gait_commands[robot], a.cycle_angles[robot],
        a.rod_angles[robot], a.fin_wrenches[robot], a.rod_rates[robot], a.rod_torques[robot])


@kernel
def _body_of(bodies: Bodies, robot: int) -> BodyConstants:
    a = bodies.values[robot]
    return BodyConstants(
        a[0], (a[1], a[2], a[3]), (a[4], a[5], a[6]), (a[7], a[8], a[9]), (a[10], a[11], a[12]), a[13],
        bodies.moves_water, (a[14], a[15], a[16], a[17], a[18], a[19]), (a[20], a[21], a[22], a[23], a[24], a[25]),
        (a[26], a[27], a[28], a[29], a[30], a[31]), a[32], 0.0, a[33])


@kernel
def _put(vector: Vector, rows: tuple[FloatArray, FloatArray, FloatArray], k: int) -> None:
    rows[0][k], rows[1][k], rows[2][k] = vector


@kernel
def _rods_of(rods: RodConstants, k: int) -> RodConstants:
    return RodConstants(
        rods.front_radius[k], rods.rear_radius[k], rods.support_length[k], vector_of(rods.motor_position, k),
        rods.time_constant[k])


@kernel
def _five(values: tuple[FloatArray, ...], k: int) -> tuple[float, ...]:
    return values[0][k], values[1][k], values[2][k], values[3][k], values[4][k]


@kernel
def _rod(rod: Rod, k: int) -> Rod:
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
            for row in range(5):
                gait.value[row][i] = one.gait[side, row]
                gait.rate[row][i] = one.gait_rates[side, row]
            gait.cycle_angle[i] = one.cycle_angles[side]


@kernel
def _move_rods(lanes: Lanes, elapsed: float) -> None:
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
        for axis in range(3):
            _put(support.rotation[axis], out.rotation[axis], i)
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
def _share(lanes: Lanes, tables: tuple[FloatArray, ...]) -> None:
    """Copy what a fin has to its chains."""
    support, acceleration, bending = lanes.support, lanes.acceleration, lanes.bending
    for axis in range(3):
        _repeat(support.velocity[axis], tables[axis])
        _repeat(support.omega[axis], tables[3 + axis])
        _repeat(acceleration.at_a[axis], tables[6 + axis])
        _repeat(acceleration.slope[axis], tables[9 + axis])
    _repeat(support.omega_dot[0], tables[12])
    _repeat(bending[0], tables[13])
    _repeat(bending[1], tables[14])


@kernel
def _repeat(lane: FloatArray, table: FloatArray) -> None:
    for chain in range(table.shape[0]):
        for i in range(LANES):
            table[chain, i] = lane[i]


@kernel
def _find_wrenches(rows: Rows, links: Links, chains: Chains) -> None:
    """Find the wrench of each chain on the support, as `support_wrench`."""
    fin = rows.fin
    count, row = links.c.shape
    fx, fy, fz, mx, my, mz = rows.sums
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
def _sum_chains(fin: FinConstants, tables: tuple[FloatArray, ...], wrench: Wrench) -> None:
    """Sum what `_wrenches` found over the chains of each fin."""
    for axis in range(3):
        _sum(fin, tables[15 + axis], wrench.force[axis])
        _sum(fin, tables[18 + axis], wrench.moment[axis])


@kernel
def _sum(fin: FinConstants, table: FloatArray, lane: FloatArray) -> None:
    for i in range(LANES):
        lane[i] = 0.0
    for chain in range(table.shape[0]):
        for i in range(LANES):
            lane[i] += table[chain, i]
    for i in range(LANES):
        lane[i] *= fin.chain_spacing[i]


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
            one.cycle_angles[side] = advance_gait(gait_of(one, side), lanes.rods.time_constant[i], time_step)


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
        _sum_chains(fin, pack.tables, lanes.wrench)
        _store_lanes(lanes, motion, time_step)
        if not pack.fixed_base:
            for robot in range(ROBOTS):
                one = _motion_of(motion, robot)
                rotation = rotation_of(one.orientation)
                current_in_world = vector_at(bodies.current[robot], 0)
                none = (0.0, 0.0, 0.0)
                inputs = Inputs(current_in_world, Wrench(none, none), Wrench(none, none))
                if not step_body(
                        _BodyStep(_body_of(bodies, robot), time_step), inputs, rotation,
                        rotate_back(rotation, current_in_world), deep(), one):
                    return robot
    for robot in range(ROBOTS):
        one = _motion_of(motion, robot)
        store_rods(_rods_of(lanes.rods, robot), one)
    return -1


def _flat(value: Any) -> list[float]:
    return [value] if not isinstance(value, tuple) else [number for part in value for number in _flat(part)]


def _array_tuple(count: int, length: int) -> tuple[FloatArray, ...]:
    return tuple(aligned_zeros((count, length)))


def pack_of(robots: list[tuple[Constants, FloatArray, Motion]]) -> Pack:
    """Return the pack of up to `ROBOTS` robots with as many chains and links, each with its current.

    It is filled up with copies of the last robot.
    """
    constants, currents, motions = zip(*robots, *[robots[-1]] * (ROBOTS - len(robots)), strict=True)
    motion = Motion(*(np.stack(field) for field in zip(*motions, strict=True)))
    _, _, chains, links = motion.joint_angles.shape
    row = chains * LANES
    both = [*constants, *constants]  # by lane

    def rows_of(values: list[Any]) -> FloatArray:
        out = aligned_zeros((row,))
        out[:] = np.tile(np.array(values, dtype=float), chains)
        return out

    fins = [each.fin for each in both]
    station = aligned_zeros((row,))
    station.reshape(chains, LANES)[:] = np.stack([each.station[:chains] for each in fins], axis=1)
    fin_rows = FinConstants(chains, station, *(
        rows_of([getattr(each, name) for each in fins]) for name in FinConstants._fields[2:]))
    def lane(values: list[Any]) -> FloatArray:
        out = aligned_zeros((LANES,))
        out[:] = values
        return out

    rods = [each.rods for each in both]
    rod_lanes = RodConstants(*(lane([getattr(each, name) for each in rods]) for name in RodConstants._fields[:3]), tuple(
        lane([each.motor_position[axis] for each in rods]) for axis in range(3)), lane([each.time_constant for each in rods]))
    three, five = lambda: _array_tuple(3, LANES), lambda: _array_tuple(5, LANES)
    commands = five()
    for number in range(5):
        commands[number][:] = np.concatenate((motion.gait_commands[:, 0, number], motion.gait_commands[:, 1, number]))
    lanes = Lanes(
        rods=rod_lanes, gait=Gait(five(), five(), commands, aligned_zeros((LANES,))),
        body=BodyMotion(three(), three(), three(), three()), current=three(), front=Rod(*three()), rear=Rod(*three()),
        support=SupportMotion((three(), three(), three()), three(), three(), three(), three(), three()),
        acceleration=SupportAcceleration(three(), three()), bending=_array_tuple(2, LANES),
        wrench=Wrench(three(), three()))
    wide = lambda: _array_tuple(3, row)
    rows = Rows(
        fin=fin_rows, velocity=wide(), omega=wide(), roll_acceleration=aligned_zeros((row,)),
        acceleration=SupportAcceleration(wide(), wide()), bending=_array_tuple(2, row), sums=_array_tuple(6, row),
        zeros=aligned_zeros((row,)))
    bodies = Bodies(
        values=np.array([
            [number for name, value in each.body._asdict().items() if name not in ('moves_water', 'unsupported_weight')
             for number in _flat(value)] for each in constants]),
        moves_water=any(each.body.moves_water for each in constants),
        current=np.stack(currents),
        highest=np.array([each.surface_height - each.reach for each in constants]))
    work = packed_workspace(row, links)
    for joints, name in ((motion.joint_angles, 'q'), (motion.joint_rates, 'q_dot')):
        rows_of_links = getattr(links_of.py_func(work, 0), name)
        rows_of_links.reshape(links, chains, 2, ROBOTS)[:] = joints.transpose(3, 2, 1, 0)
    changing = (
        *rows.velocity, *rows.omega, *rows.acceleration.at_a, *rows.acceleration.slope, rows.roll_acceleration,
        *rows.bending, *rows.sums)
    return Pack(lanes, rows, tuple(each.reshape(chains, LANES) for each in changing), bodies, motion, work, constants[0].time_step, constants[0].fixed_base)


def motions_of(pack: Pack) -> list[Motion]:
    """Return the motion of each robot, in new arrays."""
    links = links_of.py_func(pack.work, 0)
    for rows, joints in ((links.q, pack.motion.joint_angles), (links.q_dot, pack.motion.joint_rates)):
        joints[:] = rows.reshape(len(rows), -1, 2, ROBOTS).transpose(3, 2, 1, 0)
    return [Motion(*(field[robot].copy() for field in pack.motion)) for robot in range(ROBOTS)]
