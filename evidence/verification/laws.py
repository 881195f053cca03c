"""Theme 1, laws: the balance of work and energy of body and fins together, and Galilean invariance."""
from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import cumulative_simpson

from evidence.scenarios import TWIST, WATER_OF_BODY
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.figures import draw_convergence, fitted_order
from evidence.verification.mechanics import Commands, History, energy, power, recorded, to_world, without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, SEQUENTIAL, FloatArray, Parameters, Simulator, State
from manta_sim_ros.figures.gaits import STRAIGHT, gait

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COUPLINGS = {'staggered': SEQUENTIAL, 'monolithic': MONOLITHIC}
"""Values of `solver.coupling` by the names that the page uses for them."""
ORDERS = {'staggered': 1, 'monolithic': 4}
SIZE = {'chains': 8, 'links': 3}
STEPS = 2e-3, 1e-3, 5e-4, 2.5e-4  # [s]; the claims use the first two
WEAK = gait(20.0, 0.6)
ADDED_MASS = 1.0  # C_a of a thin plate
BEYOND = 'monolithic with all beyond the paper'


def robot(coupling: str, time_step: float, **groups: dict) -> Parameters:
    """Return the parameters of a robot of `SIZE` that follows commands at once; `groups` replaces other values."""
    solver = {'coupling': coupling, 'time_step': time_step, **groups.pop('solver', {})}
    return without_smoothing(Parameters().replace(**{'fin': SIZE, **groups}, solver=solver))


def followed(
    parameters: Parameters, commands: Commands, lead_in: float, duration: float, start: State | None = None,
    every: int = 1,
) -> History:
    """Command the gaits, advance by `lead_in` [s], and return the history of `duration` [s], every `every` steps."""
    simulator = Simulator(parameters, state=start)
    simulator.command(left=commands[0], right=commands[1])
    simulator.advance(lead_in)
    return recorded(simulator, commands, duration, every)


@dataclasses.dataclass(frozen=True)
class Balance:
    """Energy stored and work done since the first time (T,) [J]."""

    time: FloatArray
    stored: FloatArray
    work: dict[str, FloatArray]

    @property
    def residual(self) -> FloatArray:
        """Energy stored minus work done (T,), over the total work of the rods."""
        return (self.stored - sum(self.work.values())) / self.work['rods'][-1]


def _balance(parameters: Parameters) -> Balance:
    """Return the balance over 0.8 s of the paper's gait; the work is Simpson's integral of the power at every step."""
    history = followed(parameters, (STRAIGHT, STRAIGHT), 0.2, 0.8)
    stored = sum(energy(parameters, history).values())
    work = {name: cumulative_simpson(values, dx=parameters.solver.time_step, initial=0.0)
            for name, values in power(parameters, history).items()}
    return Balance(history.time, stored - stored[0], work)


def work_and_energy(quick: bool = False) -> Section:
    """Compare the work of the rods, the water and the dampers with the energy that is stored."""
    steps = STEPS[:2] if quick else STEPS[:3]
    cases = {
        'body held': ('monolithic', {'solver': {'fixed_base': True}}),
        'monolithic': ('monolithic', {}),
        'monolithic with added mass': ('monolithic', {'water': {'added_mass_coefficient': ADDED_MASS}}),
        BEYOND: ('monolithic', {
            'water': {'added_mass_coefficient': ADDED_MASS}, 'fin': {**SIZE, **TWIST}, 'body': WATER_OF_BODY}),
        'staggered': ('staggered', {}),
    }
    balances = {name: [_balance(robot(COUPLINGS[coupling], step, **groups)) for step in steps]
                for name, (coupling, groups) in cases.items()}
    errors = {name: [float(np.abs(run.residual).max()) for run in runs] for name, runs in balances.items()}
    orders = {name: fitted_order(steps[:2], values[:2]) for name, values in errors.items()}
    coarse, fine = (balances['staggered'][index].residual[-1] for index in range(2))
    reference = 'power of the forces, summed link by link in NumPy'
    fourth = 'fourth order; measured with a margin of 3 to 5'
    claims = [
        Claim(f'residual of work and energy, {name}, step 2 ms', reference, errors[name][0], tolerance, fourth)
        for name, tolerance in (
            ('body held', 1.5e-6), ('monolithic', 2e-7), ('monolithic with added mass', 1e-7), (BEYOND, 1e-7))
    ]
    claims += [
        Claim('residual of work and energy, staggered, step 2 ms', reference, errors['staggered'][0], 8e-3,
              'first order, since fins and body exchange their states a step late; measured with a margin below 2'),
        Claim('residual of work and energy, staggered, extrapolated to step 0', reference,
              float(abs(2.0 * fine - coarse)), 2e-4, 'the second order remains; measured with a margin of 2.5'),
        Claim('order of the residual, body held', 'order 4 of the Runge-Kutta method', orders['body held'], (3.5, 4.5),
              'derived: 4; the kinks of |V.n| may change it by half an order'),
        Claim('order of the residual, monolithic', 'order 4 of the Runge-Kutta method', orders['monolithic'],
              (3.5, 4.5), 'derived: 4; the kinks of |V.n| may change it by half an order'),
        Claim('order of the residual, staggered', 'order 1 of the forward Euler method', orders['staggered'],
              (0.9, 1.1), 'derived: 1; the second order changes it by less than a tenth'),
    ]

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        run = balances['monolithic with added mass'][0]
        for name, values in run.work.items():
            left.plot(run.time, values, label=name)
        left.plot(run.time, run.stored, 'k--', label='stored')
        left.set(xlabel='time [s]', ylabel='work since the first time [J]')
        left.legend()
        draw_convergence(right, [1e3 * step for step in steps], errors,
                         {name: ORDERS[coupling] for name, (coupling, _) in cases.items()}, label='step [ms]')
        right.set_ylabel('residual over work of rods')

    work = balances['monolithic'][0].work
    return Section(
        'Work and energy', f"""
The robot swims with the paper's gait (A = 40 degrees, f = 0.6 Hz, phi = 40 degrees). The work of the rods,
{rounded(work['rods'][-1], 3)} J in {rounded(balances['monolithic'][0].time[-1] - balances['monolithic'][0].time[0])} s,
must equal the change of kinetic, elastic and buoyancy energy plus the energy that the water
({rounded(-work['drag'][-1], 3)} J) and the dampers ({rounded(-work['dampers'][-1])} J) absorb.

The reference shares no code with the simulator. `evidence/verification/mechanics.py` takes the states that the
simulator returns, computes the position of each link from the closure of the mechanism, differentiates it exactly, and
sums the kinetic energy over point masses. Only the wrench of a fin on its support comes from the simulator: the power
of the rods is minus that wrench times the motion of the support relative to the body. A wrong sign or a wrong factor in
the wrench, the drag, the springs, the inertia or the coupling therefore leaves a residual that does not decrease with
the step. The added mass exerts the force -m_a n (n.a), where a is the numerical derivative of the midpoints'
velocities. Its power is a separate term, because it is not the rate of an energy: n rotates. The case "all beyond the
paper" adds the twist of the fins with its damping, and the added mass, the damping and the net buoyancy of the body.

The balance says nothing about the values of the coefficients, since it holds for any C_D.
""", tuple(claims), draw,
        'Left: work since the first time, monolithic with added mass, step 2 ms. Right: residual against the step.')


CURRENT = np.array([0.3, -0.2, 0.1])  # [m/s]


def frame_of_reference(quick: bool = False) -> Section:
    """Compare a turn in a current with the same turn in still water, seen from a frame that moves with the water."""
    steps = STEPS[:2] if quick else STEPS[:3]
    cases: dict[str, tuple[str, dict]] = {name: (coupling, {}) for name, coupling in COUPLINGS.items()}
    cases['monolithic, body in water'] = MONOLITHIC, {'body': WATER_OF_BODY}
    differences: dict[str, list[float]] = {name: [] for name in cases}
    for name, (coupling, groups) in cases.items():
        for step in steps:
            still = robot(coupling, step, **groups)
            flowing = still.replace(water={'current': CURRENT})
            carried = dataclasses.replace(State.at_rest(flowing), twist=np.concatenate([CURRENT, np.zeros(3)]))
            one = followed(still, (STRAIGHT, WEAK), 0.0, 2.0, every=50)
            other = followed(flowing, (STRAIGHT, WEAK), 0.0, 2.0, carried, every=50)
            velocities = [np.einsum('tab,tb->ta', to_world(run), run.twist[:, :3]) for run in (one, other)]
            differences[name].append(float(max(
                np.abs(other.position - one.position - np.outer(one.time, CURRENT)).max() / np.ptp(one.position),
                np.abs(velocities[1] - velocities[0] - CURRENT).max() / np.abs(velocities[0]).max(),
                np.abs(other.joint_angles - one.joint_angles).max() / np.abs(one.joint_angles).max())))
    orders = {name: fitted_order(steps[:2], values[:2]) for name, values in differences.items()}
    reference = 'the same motion in still water'
    claims = (
        Claim('effect of a uniform current, monolithic, step 2 ms', reference, differences['monolithic'][0], 2e-10,
              'fourth order; measured with a margin of 3'),
        Claim('effect of a uniform current, monolithic, body in water, step 2 ms', reference,
              differences['monolithic, body in water'][0], 4e-10, 'fourth order; measured with a margin of 3'),
        Claim('effect of a uniform current, staggered, step 2 ms', reference, differences['staggered'][0], 3e-4,
              "first order: forward Euler rotates the current's velocity with the body; measured with a margin of 3"),
        Claim('order of the effect of a current, monolithic', 'order 4 of the Runge-Kutta method', orders['monolithic'],
              (3.5, 4.7), 'derived: 4'),
        Claim('order of the effect of a current, staggered', 'order 1 of the forward Euler method', orders['staggered'],
              (0.85, 1.15), 'derived: 1'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        orders_drawn = {name: ORDERS[name.partition(',')[0]] for name in differences}
        draw_convergence(axes, [1e3 * step for step in steps], differences, orders_drawn, label='step [ms]')
        axes.set_ylabel('largest difference, relative')

    return Section('Galilean invariance', f"""
A robot turns (A = 40 degrees on the left, 20 degrees on the right) in a uniform current of
{rounded(float(np.linalg.norm(CURRENT)))} m/s, which carries it along from the start. Its motion must be the same as in
still water, seen from a frame that moves with the water. The position, the velocity in the world frame and all joint
angles are compared over 2 s, each relative to its range. The body rotates meanwhile, so every product of velocities in
the equations of the body and of the fins takes part. In the case "body in water", the body has added mass, damping and
net buoyancy as well. This section does not verify a current that varies in time.
""", claims, draw, 'Largest difference from the motion in still water.')


CHECKS = work_and_energy, frame_of_reference
