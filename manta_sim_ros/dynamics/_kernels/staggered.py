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
    cross,
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
    motion_of,
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
from manta_sim_ros.dynamics._kernels.waterline import (
    Surface,
    add_weight,
    body_at_surface,
    deep,
    dry_links,
    parts_of_step,
    surface_at_body,
    surface_at_support,
    weight_along_support,
    with_parts,
)
from manta_sim_ros.dynamics.quantity import FloatArray, Vector


@kernel
def _fin_accelerations(
    fin: FinConstants, support: SupportMotion, current: Vector, surface: Surface, links: Links, chains: Chains,
) -> tuple[SupportAcceleration, bool]:
    """Find the accelerations of a fin's joints; return that of its support, and whether any link is above the water.

    `current` and `surface` are in F_0.
    """
    link_motion(fin, links, chains)
    add_twist_torques(fin, links, chains)
    surface_slopes(fin, links)
    water_loads(fin, subtract(support.velocity, current), support.omega, links)
    dry = surface.is_near and dry_links(fin, surface, support, current, links)
    articulated_inertia(fin, support.omega, support.omega_dot[0], links, chains)
    if dry:
        add_weight(fin, surface, links, chains)
    acceleration = support_acceleration(support)
    joint_accelerations(fin, acceleration, 0.0, links, chains)
    return acceleration, dry


@kernel
def _step_fin(
    constants: Constants, side: int, current: Vector, surface: Surface, motion: Motion, work: Workspace,
) -> int:
    """Take the step of one fin, the body's motion held; return the chain that diverged, or -1.

    `current` and `surface` are in F_b. Four stages of Runge and Kutta, and at the step's end a fifth evaluation for the
    wrench.
    """
    fin, rods, time_step = constants.fin, constants.rods, constants.time_step
    links, chains = links_of(work, side), chains_of(work)
    gait, body = gait_of(motion, side), body_motion(side, motion.twist, motion.acceleration)
    begin_joints(links)
    for stage in range(STAGES + 1):
        if stage == 0 or NODES[stage] != NODES[stage - 1]:
            front, rear = rod_motion(rods, gait, NODES[stage] * time_step)
            support = support_motion(rods, front, rear, body)
        current_0 = rotate_back(support.rotation, mirror_polar(current, side))
        surface_0 = surface_at_support(surface, side, support)
        acceleration, dry = _fin_accelerations(fin, support, current_0, surface_0, links, chains)
        if stage < STAGES:
            next_stage_of_joints(links, stage, time_step)
        if stage == STAGES - 1:
            end_joints(links)
    diverged = diverged_chain(links, fin.chains)
    if diverged >= 0:
        return diverged
    wrench = support_wrench(fin, support, acceleration, links, chains)
    if dry:
        along = weight_along_support(fin, surface_0, links)
        wrench = Wrench(add(wrench.force, along.force), add(wrench.moment, along.moment))
    store_wrench(wrench_on_body(support, wrench), side, motion.fin_wrenches)
    motion.rod_angles[side, 0], motion.rod_angles[side, 1] = front.angle, rear.angle
    motion.cycle_angles[side] = advance_gait(rods, gait, time_step)
    return -1


@kernel
def step_body(
    constants: Constants, inputs: Inputs, rotation: Rotation, current: Vector, surface: Surface, motion: Motion,
) -> bool:
    """Take the step of the body by forward Euler, the fins' wrenches known; return whether it is not too fast.

    `rotation` is R_b; `current` and `surface` are in F_b.
    """
    body, time_step, twist, wrenches = constants.body, constants.time_step, motion.twist, motion.fin_wrenches
    velocity, omega = vector_at(twist, 0), vector_at(twist, 3)
    if surface.is_near:
        body = body_at_surface(body, surface, velocity, omega)
    load = body_wrench(body, inputs, rotation, velocity, omega, current)
    force = add(load.force, add(vector_at(wrenches[0], 0), vector_at(wrenches[1], 0)))
    moment = add(load.moment, add(vector_at(wrenches[0], 3), vector_at(wrenches[1], 3)))
    velocity_dot, omega_dot = body_acceleration(body, Wrench(force, moment))
    if body.unsupported_weight != 0.0:  # the second order, which Euler's scheme lacks, keeps the energy of a free fall
        velocity_dot_0 = add(velocity_dot, cross(omega, velocity))
        velocity = (
            velocity[0] + 0.5 * time_step * velocity_dot_0[0], velocity[1] + 0.5 * time_step * velocity_dot_0[1],
            velocity[2] + 0.5 * time_step * velocity_dot_0[2])
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
    constants: Constants, inputs: Inputs, values: FloatArray, work: Workspace, steps: int,
) -> tuple[int, int, int, int]:
    """Take `steps` steps in place; return the fields of an `Outcome`. The motion lies in `values`."""
    if steps == 0:
        return 0, 0, 0, 0
    motion = motion_of(values, constants.fin.chains, work.kept.shape[2])
    load_joints(motion, work)
    for step in range(steps):
        surface = surface_at_body(constants, motion.position[2], rotation_of(motion.orientation))
        parts = parts_of_step(constants, surface, motion.twist, motion.rod_angles, work)
        part = with_parts(constants, parts)
        for _ in range(parts):
            rotation = rotation_of(motion.orientation)
            current = rotate_back(rotation, inputs.current)
            surface = surface_at_body(constants, motion.position[2], rotation)
            for side in range(2):
                diverged = _step_fin(part, side, current, surface, motion, work)
                if diverged >= 0:
                    return step, FIN_DIVERGED, side, diverged
            if not constants.fixed_base and not step_body(part, inputs, rotation, current, surface, motion):
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
    acceleration, _ = _fin_accelerations(constants.fin, support, (0.0, 0.0, 0.0), deep(), links, chains)
    wrench = wrench_on_body(support, support_wrench(constants.fin, support, acceleration, links, chains))
    from_rows(links.q_ddot, state.joint_accelerations)
    return mirror_polar(wrench.force, side), mirror_axial(wrench.moment, side)
