"""Fins and body one after the other in each step, Section 4 and Figure 6: the paper's coupling, of first order."""

from __future__ import annotations

from manta_sim_ros.dynamics._kernels.actuation import SupportMotion, body_motion, support_motion
from manta_sim_ros.dynamics._kernels.body import body_acceleration, body_wrench, slower_than
from manta_sim_ros.dynamics._kernels.compilation import entry_kernel, kernel
from manta_sim_ros.dynamics._kernels.constants import Constants, FinConstants
from manta_sim_ros.dynamics._kernels.fin import (
    SupportAcceleration,
    add_twist_torques,
    articulated_inertia,
    joint_accelerations,
    link_motion,
    support_acceleration,
    support_wrench,
    surface_slopes,
    water_loads,
    wrench_on_body,
)
from manta_sim_ros.dynamics._kernels.gait import Rod, advance_gait, rod_motion
from manta_sim_ros.dynamics._kernels.geometry import (
    Rotation,
    Wrench,
    add,
    integrate_quaternion,
    mirror_axial,
    mirror_polar,
    rotate,
    rotate_back,
    rotation_of,
    subtract,
    vector_at,
)
from manta_sim_ros.dynamics._kernels.inputs import Inputs
from manta_sim_ros.dynamics._kernels.layout import Chains, Links, Workspace, chains_of, from_rows, links_of, to_rows
from manta_sim_ros.dynamics._kernels.motion import (
    BODY_DIVERGED,
    FASTEST,
    FIN_DIVERGED,
    FinState,
    Motion,
    diverged_chain,
    gait_of,
    load_joints,
    store_joints,
    store_rods,
    store_wrench,
)
from manta_sim_ros.dynamics._kernels.runge_kutta import (
    NODES,
    STAGES,
    begin_joints,
    end_joints,
    next_stage_of_joints,
)
from manta_sim_ros.dynamics.quantity import Vector


@kernel
def _fin_accelerations(
    fin: FinConstants, support: SupportMotion, current: Vector, links: Links, chains: Chains,
) -> SupportAcceleration:
    """Find the accelerations of a fin's joints; return that of its support. `current` is in F_0."""
    link_motion(fin, links, chains)
    add_twist_torques(fin, links, chains)
    surface_slopes(fin, links)
    water_loads(fin, subtract(support.velocity, current), support.omega, links)
    articulated_inertia(fin, support.omega, support.omega_dot[0], links, chains)
    acceleration = support_acceleration(support)
    joint_accelerations(fin, acceleration, 0.0, links, chains)
    return acceleration


@kernel
def _step_fin(constants: Constants, side: int, current: Vector, motion: Motion, work: Workspace) -> int:
    """Take the step of one fin, the body's motion held; return the chain that diverged, or -1.

    `current` is in F_b. Four stages of Runge and Kutta, and at the step's end a fifth evaluation for the wrench.
    """
    fin, rods, time_step = constants.fin, constants.rods, constants.time_step
    links, chains = links_of(work, side), chains_of(work)
    gait, body = gait_of(motion, side), body_motion(side, motion.twist, motion.acceleration)
    begin_joints(links)
    for stage in range(STAGES + 1):
        front, rear = rod_motion(rods, gait, NODES[stage] * time_step)
        support = support_motion(rods, front, rear, body)
        current_0 = rotate_back(support.rotation, mirror_polar(current, side))
        acceleration = _fin_accelerations(fin, support, current_0, links, chains)
        if stage < STAGES:
            next_stage_of_joints(links, stage, time_step)
        if stage == STAGES - 1:
            end_joints(links)
    diverged = diverged_chain(links, fin.chains)
    if diverged >= 0:
        return diverged
    wrench = support_wrench(fin, support, acceleration, links, chains)
    store_wrench(wrench_on_body(support, wrench), side, motion.fin_wrenches)
    motion.rod_angles[side, 0], motion.rod_angles[side, 1] = front.angle, rear.angle
    motion.cycle_angles[side] = advance_gait(gait, rods.time_constant, time_step)
    return -1


@kernel
def _step_body(constants: Constants, inputs: Inputs, rotation: Rotation, current: Vector, motion: Motion) -> bool:
    """Take the step of the body by forward Euler, the fins' wrenches known; return whether it is not too fast.

    `rotation` is R_b; `current` is in F_b.
    """
    time_step, twist, wrenches = constants.time_step, motion.twist, motion.fin_wrenches
    velocity, omega = vector_at(twist, 0), vector_at(twist, 3)
    load = body_wrench(constants.body, inputs, rotation, velocity, omega, current)
    force = add(load.force, add(vector_at(wrenches[0], 0), vector_at(wrenches[1], 0)))
    moment = add(load.moment, add(vector_at(wrenches[0], 3), vector_at(wrenches[1], 3)))
    velocity_dot, omega_dot = body_acceleration(constants.body, Wrench(force, moment))
    position_dot = rotate(rotation, velocity)
    integrate_quaternion(motion.orientation, omega, time_step)
    for axis in range(3):
        motion.position[axis] += time_step * position_dot[axis]
        motion.acceleration[axis], motion.acceleration[3 + axis] = velocity_dot[axis], omega_dot[axis]
        twist[axis] += time_step * velocity_dot[axis]
        twist[3 + axis] += time_step * omega_dot[axis]
    return slower_than(FASTEST, twist)


@entry_kernel
def advance(
    constants: Constants, inputs: Inputs, motion: Motion, work: Workspace, steps: int,
) -> tuple[int, int, int, int]:
    """Take `steps` steps in place; return the fields of an `Outcome`."""
    if steps == 0:
        return 0, 0, 0, 0
    load_joints(motion, work)
    for step in range(steps):
        rotation = rotation_of(motion.orientation)
        current = rotate_back(rotation, inputs.current)
        for side in range(2):
            diverged = _step_fin(constants, side, current, motion, work)
            if diverged >= 0:
                return step, FIN_DIVERGED, side, diverged
        if not constants.fixed_base and not _step_body(constants, inputs, rotation, current, motion):
            return step, BODY_DIVERGED, 0, 0
    store_joints(work, motion)
    store_rods(constants.rods, motion)
    return steps, 0, 0, 0


@entry_kernel
def evaluate(constants: Constants, side: int, state: FinState, work: Workspace) -> tuple[Vector, Vector]:
    """Fill the accelerations of one fin's joints in still water; return force and moment on the body, in F_b."""
    links, chains = links_of(work, side), chains_of(work)
    to_rows(state.joint_angles, links.q)
    to_rows(state.joint_rates, links.q_dot)
    front = Rod(state.rods[0, 0], state.rods[0, 1], state.rods[0, 2])
    rear = Rod(state.rods[1, 0], state.rods[1, 1], state.rods[1, 2])
    body = body_motion(side, state.body_twist, state.body_acceleration)
    support = support_motion(constants.rods, front, rear, body)
    acceleration = _fin_accelerations(constants.fin, support, (0.0, 0.0, 0.0), links, chains)
    wrench = wrench_on_body(support, support_wrench(constants.fin, support, acceleration, links, chains))
    from_rows(links.q_ddot, state.joint_accelerations)
    return mirror_polar(wrench.force, side), mirror_axial(wrench.moment, side)
