"""Fins and body solved together: the whole state by the classical Runge-Kutta scheme, of fourth order.

The wrench of a fin is affine in the body's acceleration: `fin_inertia` gives both parts, and (36) with them is six
linear equations for that acceleration, at every stage.
"""

from __future__ import annotations

from manta_sim_ros.dynamics._kernels.actuation import SupportMotion, body_motion, support_motion
from manta_sim_ros.dynamics._kernels.body import (
    attitude,
    body_derivative,
    body_wrench,
    normalize,
    slower_than,
    solve_body,
)
from manta_sim_ros.dynamics._kernels.compilation import entry_kernel, kernel
from manta_sim_ros.dynamics._kernels.constants import Constants, FinConstants
from manta_sim_ros.dynamics._kernels.fin import (
    SupportAcceleration,
    acceleration_slope,
    add_twist_torques,
    articulated_inertia,
    joint_accelerations,
    link_motion,
    support_acceleration,
    surface_slopes,
    water_loads,
    wrench_on_body,
)
from manta_sim_ros.dynamics._kernels.fin_inertia import (
    fin_inertia,
    inertia_in_body,
    take_off_oblique_torques,
    wrench_at_support,
)
from manta_sim_ros.dynamics._kernels.gait import Rod, advance_gait, rod_motion
from manta_sim_ros.dynamics._kernels.geometry import mirror_axial, mirror_polar, rotate_back, subtract, vector_at
from manta_sim_ros.dynamics._kernels.inputs import Inputs
from manta_sim_ros.dynamics._kernels.layout import (
    BodyArrays,
    Chains,
    Links,
    Workspace,
    chains_of,
    from_rows,
    links_of,
    to_rows,
)
from manta_sim_ros.dynamics._kernels.motion import (
    BODY_DIVERGED,
    FASTEST,
    FIN_DIVERGED,
    NO_SOLUTION,
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
    begin,
    begin_joints,
    end,
    end_joints,
    next_stage,
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

MIRROR = (1.0, -1.0, 1.0, -1.0, 1.0, -1.0)
"""Signs of the components of a twist or wrench in the mirror y = 0."""


@kernel
def _find_fin_inertia(
    fin: FinConstants, support: SupportMotion, current: Vector, surface: Surface, links: Links, chains: Chains,
    arrays: BodyArrays,
) -> None:
    """Find the inertia and bias of a fin as its support feels it, about A. `current` and `surface` are in F_0."""
    link_motion(fin, links, chains)
    add_twist_torques(fin, links, chains)
    surface_slopes(fin, links)
    water_loads(fin, subtract(support.velocity, current), support.omega, links)
    dry = surface.is_near and dry_links(fin, surface, support, current, links)
    articulated_inertia(fin, support.omega, 0.0, links, chains)
    if dry:
        add_weight(fin, surface, links, chains)
    fin_inertia(fin, support.omega, links, chains, arrays)
    if dry:
        along = weight_along_support(fin, surface, links)
        for i in range(3):
            arrays.bias[i] -= along.force[i]
            arrays.bias[3 + i] -= along.moment[i]


@kernel
def _find_joint_accelerations(
    fin: FinConstants, a: Vector, omega: Vector, omega_dot: Vector, links: Links, chains: Chains,
) -> None:
    """Find the accelerations of a fin's joints, given those of its support, `a` of A and Omega_0-dot, in F_0."""
    if fin.added_mass > 0.0:
        take_off_oblique_torques(a, omega_dot, links)
    acceleration = SupportAcceleration(a, acceleration_slope(omega, omega_dot))
    joint_accelerations(fin, acceleration, omega_dot[0], links, chains)


@kernel
def _couple_fin(side: int, support: SupportMotion, arrays: BodyArrays) -> None:
    """Fill the wrench and the inertia of a fin as the body feels them; `support` is its motion at no acceleration."""
    a, omega_dot = support_acceleration(support).at_a, support.omega_dot
    for i in range(3):
        arrays.support[side, i], arrays.support[side, 3 + i] = a[i], omega_dot[i]
        arrays.omega[side, i] = support.omega[i]
    store_wrench(wrench_on_body(support, wrench_at_support(a, omega_dot, arrays)), side, arrays.wrench)
    inertia_in_body(support, arrays.transform[side], arrays)
    for i in range(6):
        for j in range(6):
            sign = MIRROR[i] * MIRROR[j] if side == 1 else 1.0
            arrays.inertia[side, i, j] = arrays.at_support[i, j] * sign


@kernel
def _support_acceleration(side: int, arrays: BodyArrays) -> tuple[Vector, Vector]:
    """Return the acceleration of A and Omega_0-dot of one support, in F_0, with the acceleration of the body."""
    return (
        (_component(side, 0, arrays), _component(side, 1, arrays), _component(side, 2, arrays)),
        (_component(side, 3, arrays), _component(side, 4, arrays), _component(side, 5, arrays)),
    )


@kernel
def _component(side: int, row: int, arrays: BodyArrays) -> float:
    total = arrays.support[side, row]
    for j in range(6):
        sign = MIRROR[j] if side == 1 else 1.0
        total += arrays.transform[side, row, j] * (sign * arrays.acceleration[j])
    return total


@kernel
def _accelerations(constants: Constants, inputs: Inputs, elapsed: float, motion: Motion, work: Workspace) -> bool:
    """Find the accelerations of body and joints `elapsed` [s] into a step; return whether there are any."""
    fin, rods, arrays = constants.fin, constants.rods, work.body
    chains, state = chains_of(work), arrays.state[0]
    rotation = attitude(state)
    current, surface = rotate_back(rotation, inputs.current), surface_at_body(constants, state[2], rotation)
    for side in range(2):
        links = links_of(work, side)
        front, rear = rod_motion(rods, gait_of(motion, side), elapsed)
        support = support_motion(rods, front, rear, body_motion(side, state[7:], arrays.at_rest))
        current_0 = rotate_back(support.rotation, mirror_polar(current, side))
        surface_0 = surface_at_support(surface, side, support)
        _find_fin_inertia(fin, support, current_0, surface_0, links, chains, arrays)
        _couple_fin(side, support, arrays)
        motion.rod_angles[side, 0], motion.rod_angles[side, 1] = front.angle, rear.angle
    if not constants.fixed_base:
        body, velocity, omega = constants.body, vector_at(state, 7), vector_at(state, 10)
        if surface.is_near:
            body = body_at_surface(body, surface, velocity, omega)
        load = body_wrench(body, inputs, rotation, velocity, omega, current)
        if not solve_body(body, load, arrays):
            return False
        body_derivative(state, rotation, arrays.acceleration, arrays.slope[0])
    for side in range(2):
        a, omega_dot = _support_acceleration(side, arrays)
        omega_0 = vector_at(arrays.omega[side], 0)
        _find_joint_accelerations(fin, a, omega_0, omega_dot, links_of(work, side), chains)
    return True


@kernel
def _step(constants: Constants, inputs: Inputs, motion: Motion, work: Workspace) -> bool:
    """Take a step but for its checks; return whether there was an acceleration at every stage."""
    body, time_step = work.body, constants.time_step
    begin(body.state, body.start, body.total)
    for side in range(2):
        begin_joints(links_of(work, side))
    for stage in range(STAGES):
        if not _accelerations(constants, inputs, NODES[stage] * time_step, motion, work):
            return False
        if not constants.fixed_base:
            next_stage(body.state, body.slope, body.start, body.total, stage, time_step)
        for side in range(2):
            next_stage_of_joints(links_of(work, side), stage, time_step)
    end(body.state, body.total)
    for side in range(2):
        end_joints(links_of(work, side))
        motion.cycle_angles[side] = advance_gait(constants.rods, gait_of(motion, side), time_step)
    return True


@entry_kernel
def advance(
    constants: Constants, inputs: Inputs, values: FloatArray, work: Workspace, steps: int,
) -> tuple[int, int, int, int]:
    """Take `steps` steps in place; return the fields of an `Outcome`. The motion lies in `values`.

    Acceleration and wrenches are then those of the state that the steps end in.
    """
    if steps == 0:
        return 0, 0, 0, 0
    fin, arrays = constants.fin, work.body
    motion, state = motion_of(values, fin.chains, work.kept.shape[2]), arrays.state[0]
    for i in range(3):
        state[i] = motion.position[i]
    for i in range(4):
        state[3 + i] = motion.orientation[i]
    for i in range(6):
        state[7 + i] = motion.twist[i]
    load_joints(motion, work)
    for step in range(steps):
        surface = surface_at_body(constants, state[2], attitude(state))
        parts = parts_of_step(constants, surface, state[7:], motion.rod_angles, work)
        part = with_parts(constants, parts)
        for _ in range(parts):
            solved = _step(part, inputs, motion, work)
            for side in range(2):
                diverged = diverged_chain(links_of(work, side), fin.chains)
                if diverged >= 0:
                    return step, FIN_DIVERGED, side, diverged
            if not solved:
                return step, NO_SOLUTION, 0, 0
            if not constants.fixed_base:
                normalize(state)
            if not slower_than(FASTEST, state[7:]):
                return step, BODY_DIVERGED, 0, 0
    if not _accelerations(constants, inputs, 0.0, motion, work):
        return steps, NO_SOLUTION, 0, 0
    store_joints(work, motion)
    for i in range(3):
        motion.position[i] = state[i]
    for i in range(4):
        motion.orientation[i] = state[3 + i]
    for i in range(6):
        motion.twist[i], motion.acceleration[i] = state[7 + i], arrays.acceleration[i]
        for side in range(2):
            motion.fin_wrenches[side, i] = arrays.wrench[side, i]
            for j in range(6):
                motion.fin_wrenches[side, i] -= arrays.inertia[side, i, j] * arrays.acceleration[j]
    store_rods(constants.rods, motion)
    return steps, 0, 0, 0


@entry_kernel
def evaluate(constants: Constants, side: int, state: FinState, work: Workspace) -> tuple[Vector, Vector]:
    """Fill the accelerations of one fin's joints in still water; return force and moment on the body, in F_b."""
    fin, links, chains = constants.fin, links_of(work, side), chains_of(work)
    to_rows(state.joint_angles, links.q)
    to_rows(state.joint_rates, links.q_dot)
    front = Rod(state.rods[0, 0], state.rods[0, 1], state.rods[0, 2])
    rear = Rod(state.rods[1, 0], state.rods[1, 1], state.rods[1, 2])
    support = support_motion(constants.rods, front, rear, body_motion(side, state.body_twist, state.body_acceleration))
    a, omega, omega_dot = support_acceleration(support).at_a, support.omega, support.omega_dot
    _find_fin_inertia(fin, support, (0.0, 0.0, 0.0), deep(), links, chains, work.body)
    _find_joint_accelerations(fin, a, omega, omega_dot, links, chains)
    wrench = wrench_on_body(support, wrench_at_support(a, omega_dot, work.body))
    from_rows(links.q_ddot, state.joint_accelerations)
    return mirror_polar(wrench.force, side), mirror_axial(wrench.moment, side)
