"""Places where the print is wrong, unclear or incomplete, and what the simulator computes instead."""

from __future__ import annotations

from typing import NamedTuple


class Slip(NamedTuple):
    """One place in the paper, what is printed there, and what is implemented.

    `code` is the module.function in `manta_sim_ros.dynamics._kernels` that computes the equation, or empty for a value.
    """

    where: str
    printed: str
    implemented: str
    code: str = ''


SLIPS = (
    Slip('(7)', 'the rear rod is called l_2, but r_2 in Table 1', 'lP_0 = (0, r_2 cos a_2, r_2 sin a_2)',
         'actuation._rod_end'),
    Slip('(8), (9)', 'theta and beta "see details in [6]"',
         'sin(beta) = -dz / L, sin(theta) = dy / (L cos(beta)), R = Rz(theta) Ry(beta); dy and dz lead from the '
         'end of the rear rod to that of the front rod', 'actuation.support_attitude'),
    Slip('(10)', 'V_0-dot lacks the rotation of V_l-dot into F_0 and the products of velocities',
         'the exact derivative of the components of V_0 in F_0: V_0-dot = R^T (V_b-dot + Omega_b-dot x P + Omega_b x '
         'P-dot + P-ddot) - Omega_0/b x V_0, where P leads from the center of mass to A', 'actuation.support_motion'),
    Slip('(11)', 'the chordwise tangent is taken on one side',
         'n = t x u normalized, t = [O_j(k-1) - O_j(k+1)] + [O_j+1(k-1) - O_j+1(k+1)], where an edge chain '
         'takes the place of its missing neighbor', 'fin.surface_slopes'),
    Slip('(12)', 'the square loses the sign of V.n', 'F = -1/2 rho C_D dl |V.n| (V.n) n, per unit chord, with V '
         'relative to the water', 'fin.water_loads'),
    Slip('(13), (14)', 'the torque is not written out',
         'tau = -(2 EI / dl) tan(q/2) (1 + tan^2(q/2)), with EI = E h^3 / 12 per unit chord', 'fin.link_motion'),
    Slip('(19)', 'the elastic and damping torques are external wrenches on link j alone, so that Q_j is the sum of '
         'tau_i over i >= j',
         'they act between a link and the previous one, with a reaction: A_j^T f_j = tau_j. Otherwise (14), the '
         'balance of angular momentum and the bending of a beam are violated', 'fin.articulated_inertia'),
    Slip('(21)-(24)', 'transposes are missing, and i-1 is printed for iA',
         'beta*_j = beta_j - f_ext,j + Ad^T (beta*_j+1 + M*_j+1 zeta_j+1): Ad^T transforms '
         'every wrench, and A_i is the axis of the joint', 'fin.articulated_inertia'),
    Slip('(26)', 'the first case has M*_m twice', 'M*_m = M_m, beta*_m = beta_m - f_ext,m',
         'fin.articulated_inertia'),
    Slip('(26)', 'the second case has M_m-1 for the inertia of link j', 'M*_j = M_j + Ad^T M*_j+1 Ad',
         'fin.articulated_inertia'),
    Slip('(27)', 'the last sum has q-dot for q-ddot', 'eta_j-dot = Ad eta_0-dot + sum Ad zeta_i + sum Ad A_i q_i-ddot',
         'fin.joint_accelerations'),
    Slip('(28)', 'the last term is fi*_j', 'beta*_j', 'fin.joint_accelerations'),
    Slip('(29)', 'M q-ddot = Q is formed and solved, m x m',
         'the three passes of the articulated-body algorithm (Featherstone) solve the same equations, at a cost '
         'linear in m',
         'fin.joint_accelerations'),
    Slip('(12)-(33)', 'some quantities of a chain are per chain, and some are per unit chord',
         'mass, drag area, stiffness and damping of a chain are per unit chord, and (33) is ds = L / n times the sum '
         'over the chains at s = L - (k + 1/2) ds', 'fin.support_wrench'),
    Slip('(38)', 'A_1 "is determined by a geometric relationship, see details in [6]"', 'r_1 sin(A_1) = r_2 sin(A)',
         'gait.rod_motion'),
    Slip('Figure 9', 'the robot swims forward with phi = -40 degrees',
         'with phi > 0 the front rod leads, the wave travels from nose to tail, and the thrust is forward',
         'gait.rod_motion'),
    Slip('Section 4', 'a time step of 0.01 s',
         '0.002 s, because with these values 0.01 s is above the stability limit'),
    Slip('Table 1', 'rho = 9800 kg/m^3', 'kept as the effective density of the drag, only in (12) and (34) '
         '(`water.density`); the mass of the fin is that of 1000 kg/m^3 (`fin.density`)'),
    Slip('Table 1', 'c_j in Nm/s', '0.1 N s, that is, N m s/rad per meter of chord (`fin.joint_damping`)'),
    Slip('Table 1', 'C_M without a unit', 'N m s (`body.angular_damping`)'),
    Slip('Table 1', 'r_1, span, thickness and drag coefficient of the fin are not given', 'assumed, see below'),
)
