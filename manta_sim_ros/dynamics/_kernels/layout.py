"""How a fin lies in memory: link-major, [link, chain], so that the compiler's vector units run across chains.

Link 0 is at the root, chain 0 at the leading edge. Rows are padded, so that no loop over chains has a remainder: what
pads a row repeats the last chain.
"""

from __future__ import annotations

from math import prod
from typing import Any, NamedTuple

import numpy as np

from manta_sim_ros.dynamics._kernels.compilation import kernel
from manta_sim_ros.dynamics.quantity import FloatArray

LANES = 4
"""A row is as long as the next multiple of this many chains, the numbers that a vector unit takes at once."""

_ALIGNMENT = 64
"""Of the first row in memory [bytes]: what crosses a cache line costs a twentieth of the speed."""


class Links(NamedTuple):
    """Working arrays of one fin, [link, chain]. The letters are those of `fin`."""

    # kept for each fin
    q: FloatArray  # joint angle [rad]
    q_dot: FloatArray
    q_ddot: FloatArray
    start_q: FloatArray  # at the beginning of the step
    start_q_dot: FloatArray
    total_q: FloatArray  # start and slopes of the stages so far
    total_q_dot: FloatArray
    c: FloatArray
    s: FloatArray
    h_y: FloatArray
    h_z: FloatArray
    d_inverse: FloatArray  # 1 / D
    u: FloatArray  # tau - nu
    g_y: FloatArray  # change of the acceleration along the link, without the joints' accelerations [1/s^2]
    g_z: FloatArray
    k_1: FloatArray  # torque per component of e, for the added mass of `fin_inertia`
    k_2: FloatArray
    k_3: FloatArray
    # used by one fin after the other
    w: FloatArray
    y: FloatArray
    z: FloatArray
    y_dot: FloatArray
    z_dot: FloatArray
    torque: FloatArray  # elastic and damping torque of the link's joint [N]
    slope: FloatArray
    load: FloatArray  # of the water along (slope, -s, c) [N/m]
    mu: FloatArray  # added mass over 1 + slope^2 [kg/m]
    weight: FloatArray  # that no water carries [N/m]


_KEPT = Links._fields.index('w')


class Chains(NamedTuple):
    """Working arrays of one fin, [chain]: what a pass hands from link to link, and what it leaves at the root."""

    tip_c: FloatArray
    tip_s: FloatArray
    tip_w: FloatArray
    tip_y: FloatArray
    tip_z: FloatArray
    tip_y_dot: FloatArray
    tip_z_dot: FloatArray
    m_yy: FloatArray  # M
    m_yz: FloatArray
    m_zz: FloatArray
    p_y: FloatArray  # p
    p_z: FloatArray
    torque: FloatArray  # of the joint at the root end [N]
    a_y: FloatArray  # acceleration of the hinge [m/s^2]
    a_z: FloatArray
    w_dot: FloatArray
    b_y1: FloatArray  # B, C and r of `fin_inertia`
    b_y2: FloatArray
    b_y3: FloatArray
    b_z1: FloatArray
    b_z2: FloatArray
    b_z3: FloatArray
    c_11: FloatArray
    c_12: FloatArray
    c_13: FloatArray
    c_22: FloatArray
    c_23: FloatArray
    c_33: FloatArray
    r_1: FloatArray
    r_2: FloatArray
    r_3: FloatArray
    angle: FloatArray  # of a link to y_0 [rad]
    moment: FloatArray  # of the twist of the fin [N], to be differenced along the chord
    twist: FloatArray  # torque of the twist of the fin at a joint [N]


class BodyArrays(NamedTuple):
    """Working arrays of the monolithic coupling."""

    state: FloatArray  # (1, 13): position, orientation x, y, z, w of any norm, and twist
    start: FloatArray  # (1, 13), at the beginning of the step
    total: FloatArray  # (1, 13), start and slopes of the stages so far
    slope: FloatArray  # (1, 13), the time derivative of `state`
    acceleration: FloatArray  # (6,), of the twist's components
    at_rest: FloatArray  # (6,), zeros
    matrix: FloatArray  # (6, 6), of the six equations
    product: FloatArray  # (6, 6), scratch
    inertia: FloatArray  # (2, 6, 6) [fin], how the wrench of a fin falls with the body's acceleration, in F_b
    wrench: FloatArray  # (2, 6) [fin], the wrench of a fin when the body does not accelerate, in F_b
    transform: FloatArray  # (2, 6, 6) [fin], from the body's acceleration, mirrored, to the support's
    support: FloatArray  # (2, 6) [fin], the support's acceleration when the body does not accelerate, in F_0
    omega: FloatArray  # (2, 3) [fin], Omega_0
    at_support: FloatArray  # (6, 6), the inertia of a fin about A, in F_0
    bias: FloatArray  # (6,), of the same


class Workspace(NamedTuple):
    """The memory of a simulation's working arrays."""

    kept: FloatArray  # (2, k, links, row), the first k fields of `Links` for each fin
    shared: FloatArray  # (fields - k, links, row), the other fields
    chains: FloatArray  # (fields of `Chains`, row)
    body: Any  # BodyArrays; None for the staggered coupling, as each array costs a call time


def row_length(chains: int) -> int:
    """Return the length of a row that holds `chains` chains."""
    return -(-chains // LANES) * LANES


def stations(chains: int, support_length: float) -> FloatArray:
    """Return where the chains stand on the support, s from A [m], midpoint rule, padded to `row_length(chains)`."""
    spacing = support_length / chains
    inside = support_length - (np.arange(chains) + 0.5) * spacing
    return np.concatenate((inside, np.full(row_length(chains) - chains, inside[-1])))


def workspace(chains: int, links: int, monolithic: bool) -> Workspace:
    """Return new memory, all zero: what a simulation without added mass never writes must stay so."""
    row = row_length(chains)
    vector, matrix = (6,), (6, 6)
    return Workspace(
        kept=aligned_zeros((2, _KEPT, links, row)),
        shared=aligned_zeros((len(Links._fields) - _KEPT, links, row)),
        chains=aligned_zeros((len(Chains._fields), row)),
        body=BodyArrays(*map(np.zeros, (
            (1, 13), (1, 13), (1, 13), (1, 13), vector, vector, matrix, matrix,
            (2, 6, 6), (2, 6), (2, 6, 6), (2, 6), (2, 3), matrix, vector))) if monolithic else None,
    )


def packed_workspace(row: int, links: int) -> Workspace:
    """Return new memory for one fin whose rows have this length, for the staggered coupling."""
    return workspace(2, 1, monolithic=False)._replace(
        kept=aligned_zeros((1, _KEPT, links, row)),
        shared=aligned_zeros((len(Links._fields) - _KEPT, links, row)),
        chains=aligned_zeros((len(Chains._fields), row)),
    )


def aligned_zeros(shape: tuple[int, ...]) -> FloatArray:
    size, spare = prod(shape), _ALIGNMENT // 8
    memory = np.zeros(size + spare)
    start = -memory.ctypes.data // 8 % spare
    return memory[start:start + size].reshape(shape)


@kernel
def links_of(work: Workspace, side: int) -> Links:
    """Return the working arrays of one fin, [link, chain]."""
    a, b = work.kept[side], work.shared
    return Links(
        a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9], a[10], a[11], a[12], a[13], a[14], a[15], a[16],
        a[17], b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], b[9],
    )


@kernel
def chains_of(work: Workspace) -> Chains:
    """Return the working arrays of the fin that is looked at, [chain]."""
    a = work.chains
    return Chains(
        a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9], a[10], a[11], a[12], a[13], a[14], a[15], a[16],
        a[17], a[18], a[19], a[20], a[21], a[22], a[23], a[24], a[25], a[26], a[27], a[28], a[29], a[30], a[31], a[32],
        a[33],
    )


@kernel
def to_rows(joints: FloatArray, rows: FloatArray) -> None:
    """Lay (n, m) out as [link, chain]."""
    last = joints.shape[0] - 1
    for j in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            rows[j, k] = joints[min(k, last), j]


@kernel
def from_rows(rows: FloatArray, joints: FloatArray) -> None:
    """Lay [link, chain] out as (n, m), without what pads a row."""
    for k in range(joints.shape[0]):
        for j in range(joints.shape[1]):
            joints[k, j] = rows[j, k]
