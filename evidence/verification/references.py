"""Theme 2, references: one fin against two other implementations, a flat plate in a stream, and a rigid pendulum."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.special import ellipk

from evidence.references import equations
from evidence.scenarios import TWIST, any_moment, sized
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.figures import draw_convergence, fitted_order
from evidence.verification.mechanics import without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, FinCommand, FloatArray, Parameters, Simulator, State, fin_dynamics

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AGREEMENT = 5e-12
SIZES = (2, 1), (4, 2), (7, 3), (5, 6), (12, 4)  # chains, links
WATERS = {'': {}, ' with added mass': {
    'water': {'added_mass_coefficient': 1.0}, 'solver': {'coupling': MONOLITHIC}},
    ' with twist': {'fin': TWIST}}


def one_fin(quick: bool = False) -> Section:
    """Compare all three implementations of both fins in random states. Needs Pinocchio."""
    from evidence.references import pinocchio_tree

    references = {'reference equations': equations.fin_dynamics, 'Pinocchio': pinocchio_tree.fin_dynamics}
    seeds = range(2 if quick else 8)
    errors: dict[str, list[float]] = {
        f'{name}{water}': [] for name in references for water in WATERS}
    joints = []
    for chains, links in SIZES[:3] if quick else SIZES:
        joints.append(chains * links)
        largest = dict.fromkeys(errors, 0.0)
        for water, groups in WATERS.items():
            parameters = sized(chains, links, **groups)
            for seed in seeds:
                moment = any_moment(parameters, seed)
                for side in range(2):
                    results = fin_dynamics(parameters, side, *moment)
                    for name, reference in references.items():
                        expected = reference(parameters, side, *moment)
                        largest[f'{name}{water}'] = max(largest[f'{name}{water}'], *(
                            float(np.abs(one - other).max() / np.abs(other).max())
                            for one, other in zip(results, expected, strict=True)))
        for name, error in largest.items():
            errors[name].append(error)
    sources = {
        'reference equations': "the paper's 6 x 6 matrices in NumPy", 'Pinocchio': 'crba and rnea of the same tree'}
    claims = tuple(
        Claim(f'error of joint accelerations and wrench, {name}{water}', sources[name], max(errors[f'{name}{water}']),
              AGREEMENT, 'rounding times the condition of the chain; measured with a margin of 20 for other machines')
        for name in references for water in WATERS)

    states = len(seeds) * len(joints) * 2

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for marker, (name, values) in zip('osx+^v', errors.items(), strict=True):
            axes.semilogy(joints, values, marker, label=name)
        axes.axhline(AGREEMENT, color='k', linestyle='--', linewidth=0.9, label='tolerance')
        axes.set(xlabel='number of joints of the fin', ylabel='largest difference, relative')
        axes.legend()

    return Section('One fin, three implementations', f"""
`fin_dynamics` is one closed, vectorized recursion. The reference equations (`evidence/references/equations.py`) follow
the paper line by line, with 6 x 6 matrices, one chain at a time, and with M q-ddot = Q solved as a whole. The Pinocchio
tree (`pinocchio_tree.py` and `mechanism.py` beside it) takes only the geometry of the mechanism, the springs and the
forces of the water from the paper. Pinocchio computes the multibody dynamics, and the right fin is modeled directly
instead of being mirrored. The implementations are compared without and with added mass, and with twist, in {states}
random states each, for fins of {len(joints)} sizes. These fins are more bent and move faster than those of a robot.
Differences are relative to the largest entry.

All three implementations were written from one page that settles the slips of the paper (`docs/paper.md`). An error in
that page would be in all of them. The balances of energy and momentum above, and the beam, the plate and the pendulum
below, do not depend on it.
""", claims, draw, 'Largest difference from the other implementations in all random states, by size.')


PLATE_CURRENTS = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, -0.1], [0.06, 0.0, 0.08], [0.0, 0.06, -0.08], [0.1, 0.0, 0.0]])


def _settled(current: FloatArray) -> tuple[FloatArray, Parameters]:
    """Return the simulated wrench (6,) [N, N m] on the held body of stiff fins at rest in a current [m/s]."""
    parameters = Parameters().replace(
        water={'current': current}, fin={'youngs_modulus': 1e11, 'joint_damping': 20.0, 'chains': 8, 'links': 1},
        solver={'fixed_base': True, 'time_step': 5e-4})
    return Simulator(parameters).advance(0.5).wrench, parameters


def flat_plate(quick: bool = False) -> Section:
    """Compare the force on a held robot with stiff, flat fins in a stream with the drag of a flat plate."""
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
        'error of the force of a stream on two flat fins', '1/2 rho C_D A |V.n| (V.n) along the normal', max(errors),
        3e-5, f'the fins bend by {rounded(bend)} rad: the sideways force and the lost area are of this order times the '
        'yaw of the hinges; measured with a margin of 3'),)
    yaw = math.degrees(math.asin((rods.front_radius - rods.rear_radius) / rods.support_length))
    return Section('A flat plate in a stream', f"""
The body is held, and the fins are stiff and flat, with an area of {rounded(area / 2.0, 3)} m^2 each. Streams of
{rounded(0.1)} m/s come from below, from above, obliquely in two planes, and along the fins. The force must be that of a
flat plate: it depends only on the component of the velocity along the normal and has the direction of that component,
so a stream along the fins exerts no force. The hinges are rotated by {rounded(yaw)} degrees against the body's x axis,
since the rods have unequal lengths, but this does not affect a flat fin. The area is that of the model, a parallelogram
with the chord L and the span as its sides. This section does not verify that C_D = {rounded(fin.drag_coefficient)} is
the drag coefficient of the real fin.
""", claims)


SUPPORT_ACCELERATION, PENDULUM_SWING = 5.0, math.radians(60.0)  # [m/s^2], [rad]


def _pendulum_period(time_step: float) -> tuple[float, float]:
    """Return the measured and the exact period [s] of one link without stiffness on a steadily accelerated support.

    Before each step the body's velocity is set to zero and its acceleration to the same upward value: without water, a
    link responds only to the acceleration of its support, which acts like gravity downward.
    """
    parameters = without_smoothing(Parameters().replace(
        water={'density': 0.0}, fin={'chains': 2, 'links': 1, 'youngs_modulus': 0.0, 'joint_damping': 0.0},
        solver={'time_step': time_step}))
    still = State.at_rest(parameters)
    acceleration = np.array([0.0, 0.0, SUPPORT_ACCELERATION, 0.0, 0.0, 0.0])
    simulator = Simulator(parameters)
    simulator.command(left=FinCommand(0.0, 0.0, 0.0), right=FinCommand(0.0, 0.0, 0.0))
    angles = np.full(still.joint_angles.shape, PENDULUM_SWING - math.pi / 2.0)
    state = dataclasses.replace(still, joint_angles=angles, acceleration=acceleration)
    exact = 4.0 * math.sqrt(2.0 * parameters.fin.span / (3.0 * SUPPORT_ACCELERATION)) * float(
        ellipk(math.sin(PENDULUM_SWING / 2.0) ** 2))
    passages = []  # times at which the link hangs straight down
    while len(passages) < 3:
        simulator.reset(state)
        after = simulator.advance(time_step)
        sides = [now.joint_angles[0, 0, 0] + math.pi / 2.0 for now in (state, after)]
        if sides[0] * sides[1] < 0.0:
            rates = [now.joint_rates[0, 0, 0] for now in (state, after)]
            passages.extend(CubicHermiteSpline([state.time, after.time], sides, rates).roots(extrapolate=False))
        state = dataclasses.replace(
            after, position=still.position, orientation=still.orientation, twist=still.twist,
            acceleration=acceleration)
    return passages[2] - passages[0], exact


def pendulum(quick: bool = False) -> Section:
    """Measure the period of one link without stiffness on a steadily accelerated support."""
    steps = (8e-3, 4e-3) if quick else (8e-3, 4e-3, 2e-3, 1e-3)
    periods = [_pendulum_period(step) for step in steps]
    exact = periods[0][1]
    errors = [abs(measured / exact - 1.0) for measured, _ in periods]
    claims = (
        Claim('error of the period of a rigid pendulum, step 4 ms', 'complete elliptic integral K', errors[1], 3e-9,
              'fourth order; measured with a margin of 3'),
        Claim("order of the pendulum's period", 'order 4 of the Runge-Kutta method',
              fitted_order(steps[:2], errors[:2]), (3.5, 4.5),
              'derived: 4, for the period and for the cubic interpolation that finds its ends'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        draw_convergence(axes, [1e3 * step for step in steps], {'period': errors}, {'period': 4}, label='step [ms]')
        axes.set_ylabel('error of the period, relative')

    return Section('A rigid pendulum', f"""
Each chain is one link without stiffness and damping, outside the water, on a support that accelerates upward with
{rounded(SUPPORT_ACCELERATION)} m/s^2. It moves like a rod that hangs from its end. When it is released at
{rounded(math.degrees(PENDULUM_SWING))} degrees, its period is 4 sqrt(2 l / 3 a) K(sin(theta/2)), which is
{rounded(exact, 4)} s. This verifies the link's inertia about its hinge, the load of an accelerated support and large
angles, all with the complete `Simulator`.
""", claims, draw, 'Error of the period against the step.')


CHECKS = one_fin, flat_plate, pendulum
