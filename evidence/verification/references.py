"""Theme 2, references: one fin against two other implementations, a flat plate in a stream, a rigid pendulum."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.special import ellipk

from evidence.references import equations, pinocchio_tree
from evidence.scenarios import any_moment, sized
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.figures import draw_convergence, fitted_order
from evidence.verification.mechanics import without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, FinCommand, Parameters, Simulator, State, fin_dynamics

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AGREEMENT = 5e-12
SIZES = (2, 1), (4, 2), (7, 3), (5, 6), (12, 4)  # chains, links
IMPLEMENTATIONS = {'literal equations': equations.fin_dynamics, 'Pinocchio': pinocchio_tree.fin_dynamics}
WATERS = {'': {}, ' with added mass': {
    'water': {'added_mass_coefficient': 1.0}, 'solver': {'coupling': MONOLITHIC}}}


def one_fin(quick: bool = False) -> Section:
    """Evaluate both fins in random states, with all three implementations."""
    seeds = range(2 if quick else 8)
    errors: dict[str, list[float]] = {
        f'{name}{water}': [] for name in IMPLEMENTATIONS for water in WATERS}
    unknowns = []
    for chains, links in SIZES[:3] if quick else SIZES:
        unknowns.append(chains * links)
        worst = dict.fromkeys(errors, 0.0)
        for water, groups in WATERS.items():
            parameters = sized(chains, links, **groups)
            for seed in seeds:
                moment = any_moment(parameters, seed)
                for side in range(2):
                    ours = fin_dynamics(parameters, side, *moment)
                    for name, peer in IMPLEMENTATIONS.items():
                        of_peer = peer(parameters, side, *moment)
                        worst[f'{name}{water}'] = max(worst[f'{name}{water}'], *(
                            float(np.abs(mine - theirs).max() / np.abs(theirs).max())
                            for mine, theirs in zip(ours, of_peer, strict=True)))
        for name, error in worst.items():
            errors[name].append(error)
    sources = {
        'literal equations': "the paper's 6 x 6 matrices in NumPy", 'Pinocchio': 'crba and rnea of the same tree'}
    claims = tuple(
        Claim(f'joint accelerations and wrench against {name}{water}', sources[name], max(errors[f'{name}{water}']),
              AGREEMENT, 'rounding times the condition of the chain; measured, margin 20 for other machines')
        for name in IMPLEMENTATIONS for water in WATERS)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for marker, (name, values) in zip('osx+', errors.items(), strict=True):
            axes.semilogy(unknowns, values, marker, label=name)
        axes.axhline(AGREEMENT, color='k', linestyle='--', linewidth=0.9, label='tolerance')
        axes.set(xlabel='joints of the fin', ylabel='largest difference, relative')
        axes.legend()

    return Section('One fin, three implementations', f"""
`fin_dynamics` is one closed, vectorized recursion. `test/equations.py` is the paper line by line: 6 x 6 matrices,
one chain at a time, M q-ddot = Q solved whole. `test/pinocchio_tree.py` takes nothing from the paper but the
mechanism's geometry, the springs and the water's forces: Pinocchio does the multibody dynamics, with the right fin
built as it stands instead of mirrored. {len(seeds) * len(unknowns) * 2} random states of each kind, bent and moving
more than a robot's fins are, in {len(unknowns)} sizes; differences are relative to the largest entry.

All three were written from one page that settles the paper's slips (`docs/paper.md`). An error in that page would be in
all; the balances of energy and momentum above, and the beam, the plate and the pendulum below, do not depend on it.
""", claims, draw, 'Largest difference to the other implementations by size, all random states.')


PLATE_CURRENTS = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, -0.1], [0.06, 0.0, 0.08], [0.0, 0.06, -0.08], [0.1, 0.0, 0.0]])


def _settled(current: NDArray) -> tuple[NDArray, Parameters]:
    """Return the wrench on the held body (6,) of stiff fins at rest in a current [m/s], by the simulator."""
    parameters = Parameters().replace(
        water={'current': current}, fin={'youngs_modulus': 1e11, 'joint_damping': 20.0, 'chains': 8, 'links': 1},
        solver={'fixed_base': True, 'time_step': 5e-4})
    return Simulator(parameters).advance(0.5).wrench, parameters


def flat_plate(quick: bool = False) -> Section:
    """Hold the robot with stiff flat fins in a stream: the drag of a flat plate."""
    errors = []
    for current in PLATE_CURRENTS:
        wrench, parameters = _settled(current)
        area = 2.0 * parameters.rods.support_length * parameters.fin.span
        pressure = 0.5 * parameters.water.density * parameters.fin.drag_coefficient
        expected = np.array([0.0, 0.0, pressure * area * abs(current[2]) * current[2]])
        scale = pressure * area * float(current @ current)
        errors.append(float(np.abs(wrench[:3] - expected).max() / scale))
    rods, fin, water = parameters.rods, parameters.fin, parameters.water
    load = 0.5 * water.density * fin.drag_coefficient * 0.01 * fin.span**3 / 2.0
    bend = load / (fin.youngs_modulus * fin.thickness**3 / 12.0)
    claims = (Claim(
        'force of a stream on two flat fins', '1/2 rho C_D A |V.n| (V.n) along the normal', max(errors), 3e-5,
        f'the fins bend by {rounded(bend)} rad: sideways force and lost area are of that order times the yaw of the '
        'hinges; measured with a margin'),)
    yaw = math.degrees(math.asin((rods.front_radius - rods.rear_radius) / rods.support_length))
    return Section('A flat plate in a stream', f"""
Body held, fins stiff and flat (A = {rounded(area / 2.0, 3)} m^2 each), streams of {rounded(0.1)} m/s from below, from
above, oblique in two planes and along the fins. The force must be that of a flat plate, with the normal part of the
velocity alone, in the direction of the flow, and none from a stream along the fins. The hinges are turned by
{rounded(yaw)} degrees to the body's axis, since the rods are of unequal length; a flat fin does not show it. The area
is the model's: a parallelogram of chord L and span. That C_D = {rounded(fin.drag_coefficient)} is right for this fin is
not shown.
""", claims)


PENDULUM_PULL, PENDULUM_SWING = 5.0, math.radians(60.0)  # [m/s^2], [rad]


def _pendulum_period(time_step: float) -> tuple[float, float]:
    """Return measured and exact period [s] of one stiff-free link, hanging from a support that accelerates steadily.

    At each step the state is handed back with the body's velocity zero and the same acceleration upward: a link in no
    water feels the acceleration of its support alone, which acts as gravity downward.
    """
    parameters = without_smoothing(Parameters().replace(
        water={'density': 0.0}, fin={'chains': 2, 'links': 1, 'youngs_modulus': 0.0, 'joint_damping': 0.0},
        solver={'time_step': time_step}))
    still = State.at_rest(parameters)
    pull = np.array([0.0, 0.0, PENDULUM_PULL, 0.0, 0.0, 0.0])
    simulator = Simulator(parameters)
    simulator.command(left=FinCommand(0.0, 0.0, 0.0), right=FinCommand(0.0, 0.0, 0.0))
    angles = np.full(still.joint_angles.shape, PENDULUM_SWING - math.pi / 2.0)
    state = dataclasses.replace(still, joint_angles=angles, acceleration=pull)
    exact = 4.0 * math.sqrt(2.0 * parameters.fin.span / (3.0 * PENDULUM_PULL)) * float(
        ellipk(math.sin(PENDULUM_SWING / 2.0) ** 2))
    passed = []  # when the link hangs down
    while len(passed) < 3:
        simulator.reset(state)
        after = simulator.advance(time_step)
        sides = [now.joint_angles[0, 0, 0] + math.pi / 2.0 for now in (state, after)]
        if sides[0] * sides[1] < 0.0:
            rates = [now.joint_rates[0, 0, 0] for now in (state, after)]
            passed.extend(CubicHermiteSpline([state.time, after.time], sides, rates).roots(extrapolate=False))
        state = dataclasses.replace(
            after, position=still.position, orientation=still.orientation, twist=still.twist, acceleration=pull)
    return passed[2] - passed[0], exact


def pendulum(quick: bool = False) -> Section:
    """Swing one link without stiffness under a steadily accelerated support."""
    steps = (8e-3, 4e-3) if quick else (8e-3, 4e-3, 2e-3, 1e-3)
    periods = [_pendulum_period(step) for step in steps]
    exact = periods[0][1]
    errors = [abs(measured / exact - 1.0) for measured, _ in periods]
    claims = (
        Claim('period of a rigid pendulum, step 4 ms', 'complete elliptic integral K', errors[1], 3e-9,
              'fourth order; measured, margin 3'),
        Claim("order of the pendulum's period", 'order 4 of Runge and Kutta', fitted_order(steps[:2], errors[:2]),
              (3.5, 4.5), 'derived: 4, for the period and for the cubic that finds its ends'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        draw_convergence(axes, [1e3 * step for step in steps], {'period': errors}, {'period': 4}, label='step [ms]')
        axes.set_ylabel('error of the period, relative')

    return Section('A rigid pendulum', f"""
One link a chain, no stiffness, no damping, no water, on a support that accelerates upward with
{rounded(PENDULUM_PULL)} m/s^2: a rod hung at its end. Let go at {rounded(math.degrees(PENDULUM_SWING))} degrees, its
period is 4 sqrt(2 l / 3 a) K(sin(theta/2)) = {rounded(exact, 4)} s. The link's inertia about its hinge, the load from
an accelerated support and large angles take part, through the whole `Simulator`.
""", claims, draw, 'Error of the period against the step.')


CHECKS = one_fin, flat_plate, pendulum
