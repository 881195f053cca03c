"""Theme 4, coupling: body and fins one after the other, or solved together, against each other and against DOP853."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evidence.references import monolithic as reference_monolithic
from evidence.references.equations import ReferenceState
from evidence.scenarios import sized
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.figures import draw_convergence, fitted_order
from evidence.verification.gaits import GAITS
from evidence.verification.laws import COUPLINGS, ORDERS, STEPS
from evidence.verification.mechanics import rods_of, without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, SEQUENTIAL, DivergenceError, FinCommand, Parameters, Simulator, State

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _pose_after(parameters: Parameters, gaits: tuple[FinCommand, FinCommand], duration: float) -> NDArray:
    """Return position [m] and orientation (7,) after so many seconds from rest."""
    simulator = Simulator(parameters)
    simulator.command(left=gaits[0], right=gaits[1])
    state = simulator.advance(duration)
    return np.concatenate([state.position, state.orientation])


def errors_of_the_step(quick: bool = False) -> Section:
    """Halve the step, for both couplings and the paper's gaits."""
    duration, size = 1.6, (8, 3)
    steps = STEPS[:2] if quick else STEPS
    errors: dict[str, dict[str, list[float]]] = {coupling: {} for coupling in COUPLINGS}
    traveled = {}
    for name, gaits in GAITS.items():
        def pose(coupling: str, step: float, gaits: tuple[FinCommand, FinCommand] = gaits) -> NDArray:
            parameters = without_smoothing(sized(*size, solver={'coupling': coupling, 'time_step': step}))
            return _pose_after(parameters, gaits, duration)

        exact = pose(MONOLITHIC, STEPS[-1] / 2.0)
        traveled[name] = float(np.linalg.norm(exact[:3]))
        for coupling in COUPLINGS:
            errors[coupling][name] = [
                float(np.linalg.norm((pose(coupling, step) - exact)[:3])) / traveled[name] for step in steps]
    claims = []
    for coupling, tolerances in ((SEQUENTIAL, (5e-3, 5e-3, 8e-3)), (MONOLITHIC, (2e-5, 1.5e-4, 6e-5))):
        for tolerance, (name, of_step) in zip(tolerances, errors[coupling].items(), strict=True):
            claims.append(Claim(
                f'position after {duration} s, {name}, {coupling}, step 2 ms', 'monolithic, step 0.125 ms', of_step[0],
                tolerance, 'over the distance covered; measured, margin 3'))
        low, high = {SEQUENTIAL: (0.85, 1.15), MONOLITHIC: (3.5, 5.0)}[coupling]
        orders = [fitted_order(steps[:2], of_step[:2]) for of_step in errors[coupling].values()]
        for order, name in zip(orders, GAITS, strict=True):
            claims.append(Claim(
                f'order of the {coupling} coupling, {name}', 'monolithic, step 0.125 ms', order, (low, high),
                f'derived: {ORDERS[coupling]}; the jump of the rods at the start adds higher orders'))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        of_all = {f'{coupling}, {name.partition(",")[0]}': of_step
                  for coupling, of_gait in errors.items() for name, of_step in of_gait.items()}
        orders = {name: ORDERS[name.partition(',')[0]] for name in of_all}
        draw_convergence(axes, [1e3 * step for step in steps], of_all, orders, label='step [ms]')
        axes.set_ylabel('error of position over distance')

    return Section('Error and order of both couplings', f"""
The paper's three gaits from rest, {size[0]} chains of {size[1]} links, {duration} s; position is compared with the
monolithic coupling at a sixteenth of the default step. The sequential coupling is of first order by construction: fins
see the body as it was at the step's beginning, and the body moves by Euler's rule. The monolithic one keeps the fourth
order of Runge and Kutta for everything. Both couplings end at the same trajectory: the limit of one is the other's.
That this limit is right is what DOP853 below and the balances of work and momentum say.
""", tuple(claims), draw, 'Error of the position against the step, three gaits.')


def _literal(state: State) -> ReferenceState:
    return ReferenceState(**{field.name: getattr(state, field.name) for field in dataclasses.fields(ReferenceState)})


def trajectory(quick: bool = False) -> Section:
    """Integrate the literal equations with DOP853 and compare the whole state."""
    duration, gaits = 0.04, GAITS['turn 2, A 40/20, 0.8 Hz']
    steps = (2e-3, 1e-3) if quick else (2e-3, 1e-3, 5e-4)
    base = without_smoothing(sized(2, 2, water={'current': (0.2, -0.1, 0.1), 'added_mass_coefficient': 1.0}, solver={
        'coupling': MONOLITHIC}))
    start = Simulator(base)
    start.command(left=gaits[0], right=gaits[1])
    begin = start.advance(0.3)

    def rods(side: int, time: float) -> NDArray:
        return rods_of(base, gaits[side], np.array([time]))[0]

    exact = reference_monolithic.trajectory(base, _literal(begin), rods, duration)
    names = 'position', 'orientation', 'twist', 'acceleration', 'joint_angles', 'joint_rates', 'fin_wrenches'
    errors: dict[str, list[float]] = {name: [] for name in names}
    for step in steps:
        simulator = Simulator(base.replace(solver={'time_step': step}), state=begin)
        found = simulator.advance(duration)
        for name in names:
            wanted = getattr(exact, name)
            errors[name].append(float(np.abs(getattr(found, name) - wanted).max() / np.abs(wanted).max()))
    worst = [max(of_name[at] for of_name in errors.values()) for at in range(len(steps))]
    claims = (
        Claim(f'whole state after {duration} s of a turn, monolithic with added mass, step 2 ms',
              'literal equations, DOP853 at 1e-11', worst[0], 4e-5, 'fourth order; measured, margin 3'),
        Claim('order toward DOP853, monolithic with added mass', 'literal equations, DOP853 at 1e-11',
              fitted_order(steps[:2], worst[:2]), (3.5, 4.5), 'derived: 4'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        draw_convergence(axes, [1e3 * step for step in steps], {'largest of the whole state': worst},
                         {'largest of the whole state': 4}, label='step [ms]')
        axes.set_ylabel('deviation from DOP853, relative')

    return Section('A trajectory by another integrator', f"""
A small robot, {base.fin.chains} chains of {base.fin.links} links, with a current and added mass, from the middle of a
turn: position, orientation, twist, acceleration, joints and wrenches after {duration} s, against SciPy's DOP853 on the
literal equations, whose linear system for the body's acceleration is found by evaluating the fins at unit
accelerations. Neither the integrator, nor the fins, nor the way in which body and fins are solved together is the
simulator's.
""", claims, draw, 'Largest deviation of any part of the state, over the largest entry of that part.')


LIGHT_BODIES = 20.0, 5.0, 2.0, 1.0, 0.5, 0.2  # [kg]
SHOWN = 0.1  # [s], of the plot
DURATION = 2.0  # [s], of their runs


def light_body(quick: bool = False) -> Section:
    """Make the body light against its fins: one coupling diverges, the other does not."""
    masses = (LIGHT_BODIES[0], LIGHT_BODIES[-1]) if quick else LIGHT_BODIES
    survived: dict[str, list[float]] = {coupling: [] for coupling in COUPLINGS}
    for coupling in COUPLINGS:
        for mass in masses:
            survived[coupling].append(_time_before_divergence(_light_body(coupling, mass, 5e-4)))

    def listed(values: Sequence[float]) -> str:
        return ', '.join(f'{value:g}' for value in values)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for coupling, step in ((SEQUENTIAL, 2e-3), (SEQUENTIAL, 5e-4), (SEQUENTIAL, 1.25e-4), (MONOLITHIC, 2e-3)):
            times, accelerations = _accelerations(_light_body(coupling, LIGHT_BODIES[2], step))
            axes.semilogy(1e3 * times, accelerations, label=f'{coupling}, step {1e3 * step:g} ms')
        axes.set(xlabel='time [ms]', ylabel="body's acceleration [m/s$^2$]", ylim=(1e-1, 1e6))
        axes.legend()

    fin = Parameters().fin
    fins = 2.0 * fin.density * fin.thickness * fin.span * Parameters().rods.support_length
    run = f'a run of {DURATION:g} s'
    claims = (
        Claim(f'time that the sequential coupling lasts, body of {masses[-1]:g} kg, step 0.5 ms', run,
              survived[SEQUENTIAL][-1], 0.5, 'shown: it must diverge, so that the limit of use is true', 's'),
        Claim(f'time that the monolithic coupling lasts, body of {masses[-1]:g} kg, step 0.5 ms', run,
              survived[MONOLITHIC][-1], (DURATION, DURATION), 'shown: the whole run', 's'),
    )
    return Section('Heavy fins, light body', f"""
The two fins weigh {rounded(fins)} kg. The sequential coupling answers the body's acceleration of the last step, so its
error grows from step to step when the body is too light against the fins: of bodies of
{listed(masses)} kg it lasts {listed(survived[SEQUENTIAL])} s of {DURATION:g} s, the monolithic one
{listed(survived[MONOLITHIC])} s. A shorter step only makes it diverge sooner (plot). Added mass makes the fins heavy,
so it is refused with the sequential coupling.
""", claims, draw, f'Acceleration of a body of {LIGHT_BODIES[2]:g} kg, 40 deg, 0.6 Hz, phi = 40 deg, from rest.')


def _light_body(coupling: str, mass: float, step: float) -> Parameters:
    inertia = tuple(moment * mass / LIGHT_BODIES[0] for moment in Parameters().body.inertia)
    return without_smoothing(sized(
        8, 3, body={'mass': mass, 'inertia': inertia}, solver={'coupling': coupling, 'time_step': step}))


def _accelerations(parameters: Parameters) -> tuple[NDArray, NDArray]:
    """Return times [s] and the linear acceleration [m/s^2] of the body in the first steps, until it diverges."""
    simulator, found = Simulator(parameters), []
    left, right = GAITS['forward, A 40, 0.6 Hz']
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        simulator.command(left=left, right=right)
    try:
        for _ in range(round(SHOWN / parameters.solver.time_step)):
            state = simulator.advance(parameters.solver.time_step)
            found.append((state.time, float(np.linalg.norm(state.acceleration[:3]))))
    except DivergenceError:
        pass
    times, accelerations = np.transpose(found)
    return times, accelerations


def _time_before_divergence(parameters: Parameters) -> float:
    """Return how long a run of `DURATION` goes [s], in tenths of a second."""
    simulator = Simulator(parameters)
    left, right = GAITS['forward, A 40, 0.6 Hz']
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # it warns of what is about to be shown
        simulator.command(left=left, right=right)
    try:
        for _ in range(round(DURATION / 0.1)):
            simulator.advance(0.1)
    except DivergenceError:
        return simulator.state.time
    return DURATION


CHECKS = errors_of_the_step, trajectory, light_body
