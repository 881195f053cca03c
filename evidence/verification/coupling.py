"""Theme 4, coupling: the staggered and the monolithic coupling, against each other and against DOP853."""

from __future__ import annotations

import dataclasses
import warnings
from typing import TYPE_CHECKING

import numpy as np

from evidence.references import monolithic as reference_monolithic
from evidence.references.equations import ReferenceState
from evidence.report import table
from evidence.scenarios import TWIST, WATER_OF_BODY, sized
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.figures import draw_convergence, fitted_order
from evidence.verification.gaits import GAITS
from evidence.verification.laws import COUPLINGS, ORDERS, STEPS
from evidence.verification.mechanics import rods_of, without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, DivergenceError, FinCommand, FloatArray, Parameters, Simulator, State

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _pose_after(parameters: Parameters, gaits: tuple[FinCommand, FinCommand], duration: float) -> FloatArray:
    """Return position [m] and orientation (7,) after `duration` [s] from rest."""
    simulator = Simulator(parameters)
    simulator.command(left=gaits[0], right=gaits[1])
    state = simulator.advance(duration)
    return np.concatenate([state.position, state.orientation])


def errors_of_the_step(quick: bool = False) -> Section:
    """Measure the error of both couplings in the paper's gaits, with the step halved repeatedly."""
    duration, size = 1.6, (8, 3)
    steps = STEPS[:2] if quick else STEPS
    errors: dict[str, dict[str, list[float]]] = {coupling: {} for coupling in COUPLINGS}
    distances = {}
    for name, gaits in GAITS.items():
        def pose(coupling: str, step: float, gaits: tuple[FinCommand, FinCommand] = gaits) -> FloatArray:
            parameters = without_smoothing(sized(*size, solver={'coupling': COUPLINGS[coupling], 'time_step': step}))
            return _pose_after(parameters, gaits, duration)

        exact = pose('monolithic', STEPS[-1] / 2.0)
        distances[name] = float(np.linalg.norm(exact[:3]))
        for coupling in COUPLINGS:
            errors[coupling][name] = [
                float(np.linalg.norm((pose(coupling, step) - exact)[:3])) / distances[name] for step in steps]
    claims = []
    for coupling, tolerances in (('staggered', (5e-3, 5e-3, 8e-3)), ('monolithic', (2e-5, 1.5e-4, 6e-5))):
        for tolerance, (name, of_step) in zip(tolerances, errors[coupling].items(), strict=True):
            claims.append(Claim(
                f'error of position after {duration} s, {name}, {coupling}, step 2 ms', 'monolithic, step 0.125 ms',
                of_step[0], tolerance, 'relative to the distance covered; measured with a margin of 3'))
        low, high = {'staggered': (0.85, 1.15), 'monolithic': (3.5, 5.0)}[coupling]
        orders = [fitted_order(steps[:2], of_step[:2]) for of_step in errors[coupling].values()]
        for order, name in zip(orders, GAITS, strict=True):
            claims.append(Claim(
                f'order of the {coupling} coupling, {name}', 'monolithic, step 0.125 ms', order, (low, high),
                f'derived: {ORDERS[coupling]}; the sudden start of the rods adds higher orders'))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        of_all = {f'{coupling}, {name.partition(",")[0]}': of_step
                  for coupling, of_gait in errors.items() for name, of_step in of_gait.items()}
        orders = {name: ORDERS[name.partition(',')[0]] for name in of_all}
        draw_convergence(axes, [1e3 * step for step in steps], of_all, orders, label='step [ms]')
        axes.set_ylabel('relative error of the position')

    return Section('Error and order of both couplings', f"""
The paper's three gaits are simulated from rest for {duration} s, with {size[0]} chains of {size[1]} links. The position
is compared with that of the monolithic coupling with a sixteenth of the default step. The staggered coupling is of
first order by construction: the fins use the body's motion at the beginning of the step, and the body moves by the
forward Euler method. The monolithic coupling keeps the fourth order of the Runge-Kutta method for the whole state. Both
couplings converge to the same trajectory. The comparison with DOP853 below, and the balances of work and momentum
above, verify that this trajectory is correct.
""", tuple(claims), draw, 'Error of the position against the step, for three gaits.')


def _reference_state(state: State) -> ReferenceState:
    return ReferenceState(**{field.name: getattr(state, field.name) for field in dataclasses.fields(ReferenceState)})


def trajectory(quick: bool = False) -> Section:
    """Compare the whole state with the reference equations, integrated by DOP853."""
    duration, gaits = 0.04, GAITS['turn of set 2, A = 40/20°, f = 0.8 Hz']
    steps = (2e-3, 1e-3) if quick else (2e-3, 1e-3, 5e-4)
    base = without_smoothing(sized(
        2, 2, water={'current': (0.2, -0.1, 0.1), 'added_mass_coefficient': 1.0}, fin=TWIST, body=WATER_OF_BODY,
        solver={'coupling': MONOLITHIC}))
    start = Simulator(base)
    start.command(left=gaits[0], right=gaits[1])
    begin = start.advance(0.3)

    def rods(side: int, time: float) -> FloatArray:
        return rods_of(base, gaits[side], np.array([time]))[0]

    exact = reference_monolithic.trajectory(base, _reference_state(begin), rods, duration)
    names = 'position', 'orientation', 'twist', 'acceleration', 'joint_angles', 'joint_rates', 'fin_wrenches'
    errors: dict[str, list[float]] = {name: [] for name in names}
    for step in steps:
        simulator = Simulator(base.replace(solver={'time_step': step}), state=begin)
        state = simulator.advance(duration)
        for name in names:
            expected = getattr(exact, name)
            errors[name].append(float(np.abs(getattr(state, name) - expected).max() / np.abs(expected).max()))
    largest = [max(of_name[at] for of_name in errors.values()) for at in range(len(steps))]
    claims = (
        Claim(f'error of the whole state after {duration} s of a turn, monolithic, all beyond the paper, step 2 ms',
              'reference equations, DOP853', largest[0], 2e-5, 'fourth order; measured with a margin of 3'),
        Claim('order of the error of the whole state, monolithic, all beyond the paper', 'reference equations, DOP853',
              fitted_order(steps[:2], largest[:2]), (3.5, 4.5), 'derived: 4'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        draw_convergence(axes, [1e3 * step for step in steps], {'whole state': largest},
                         {'whole state': 4}, label='step [ms]')
        axes.set_ylabel('deviation from DOP853, relative')

    return Section('A trajectory by another integrator', f"""
A small robot with {base.fin.chains} chains of {base.fin.links} links, in a current, with added mass, twist and the body
in water, starts in the middle of a turn. Its position, orientation, twist, acceleration, joints and wrenches after
{duration} s are compared with those of the reference equations, which SciPy's DOP853 integrates with a tolerance of
1e-12. Their linear system for the body's acceleration is found by evaluating the fins with unit accelerations. So the
integrator, the equations of the fins and the solution of body and fins together are all independent of the simulator.
""", claims, draw, 'Largest deviation of any part of the state, over the largest entry of that part.')


LIGHT_BODIES = 20.0, 5.0, 2.0, 1.0, 0.5, 0.2  # [kg]
SHOWN = 0.1  # [s], the time that the plot shows
DURATION = 2.0  # [s], of a run


def light_body(quick: bool = False) -> Section:
    """Make the body light compared with its fins: one coupling diverges, the other does not."""
    masses = (LIGHT_BODIES[0], LIGHT_BODIES[-1]) if quick else LIGHT_BODIES
    times: dict[str, list[float]] = {coupling: [] for coupling in COUPLINGS}
    for coupling in COUPLINGS:
        for mass in masses:
            times[coupling].append(_time_before_divergence(_light_body(coupling, mass, 5e-4)))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for coupling, step in (
                ('staggered', 2e-3), ('staggered', 5e-4), ('staggered', 1.25e-4), ('monolithic', 2e-3)):
            time, accelerations = _accelerations(_light_body(coupling, LIGHT_BODIES[2], step))
            axes.semilogy(1e3 * time, accelerations, label=f'{coupling}, step {1e3 * step:g} ms')
        axes.set(xlabel='time [ms]', ylabel="body's acceleration [m/s$^2$]", ylim=(1e-1, 1e6))
        axes.legend()

    fin = Parameters().fin
    fins = 2.0 * fin.density * fin.thickness * fin.span * Parameters().rods.support_length
    run = f'a run of {DURATION:g} s'
    lasted = [(f'{mass:g} kg', f'{staggered:g} s', f'{monolithic:g} s')
              for mass, staggered, monolithic in zip(masses, *times.values(), strict=True)]
    claims = (
        Claim(f'time before divergence, staggered, body of {masses[-1]:g} kg, step 0.5 ms', run,
              times['staggered'][-1], 0.5, 'it must diverge, as the limit of the staggered coupling states', 's'),
        Claim(f'time before divergence, monolithic, body of {masses[-1]:g} kg, step 0.5 ms', run,
              times['monolithic'][-1], (DURATION, DURATION), 'it must complete the run', 's'),
    )
    return Section('Heavy fins, light body', f"""
The mass of the two fins is {rounded(fins)} kg. In the staggered coupling the fins respond to the body's acceleration of
the previous step, so the error grows from step to step when the body is too light compared with the fins. The table
shows how long a run of {DURATION:g} s lasts before it diverges, in complete tenths of a second. A shorter step makes
the staggered coupling diverge earlier (see the plot). Added mass makes the fins heavier, so it is refused with the
staggered coupling.

{table(('mass of the body', *COUPLINGS), lasted)}
""", claims, draw, f'Acceleration of a body of {LIGHT_BODIES[2]:g} kg from rest; A = 40°, f = 0.6 Hz, φ = 40°.')


def _light_body(coupling: str, mass: float, step: float) -> Parameters:
    inertia = tuple(moment * mass / LIGHT_BODIES[0] for moment in Parameters().body.inertia)
    return without_smoothing(sized(
        8, 3, body={'mass': mass, 'inertia': inertia}, solver={'coupling': COUPLINGS[coupling], 'time_step': step}))


def _accelerations(parameters: Parameters) -> tuple[FloatArray, FloatArray]:
    """Return times [s] and the linear acceleration [m/s^2] of the body in the first steps, until it diverges."""
    simulator, results = Simulator(parameters), []
    left, right = GAITS['straight gait, A = 40°, f = 0.6 Hz']
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        simulator.command(left=left, right=right)
    try:
        for _ in range(round(SHOWN / parameters.solver.time_step)):
            state = simulator.advance(parameters.solver.time_step)
            results.append((state.time, float(np.linalg.norm(state.acceleration[:3]))))
    except DivergenceError:
        pass
    times, accelerations = np.transpose(results)
    return times, accelerations


def _time_before_divergence(parameters: Parameters) -> float:
    """Return the time [s] before a run of `DURATION` diverges, in tenths of a second; `DURATION` if it does not."""
    simulator = Simulator(parameters)
    left, right = GAITS['straight gait, A = 40°, f = 0.6 Hz']
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # the command warns of the divergence
        simulator.command(left=left, right=right)
    try:
        for _ in range(round(DURATION / 0.1)):
            simulator.advance(0.1)
    except DivergenceError:
        return simulator.state.time
    return DURATION


CHECKS = errors_of_the_step, trajectory, light_body
