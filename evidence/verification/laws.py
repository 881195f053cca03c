"""Theme 1, laws: the balance of work and energy of body and fins together, and the choice of an inertial frame."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson

from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.figures import draw_convergence, fitted_order
from evidence.verification.mechanics import Commands, History, energy, power, recorded, to_world, without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, SEQUENTIAL, Parameters, Simulator, State
from manta_sim_ros.figures.gaits import STRAIGHT, gait

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COUPLINGS = SEQUENTIAL, MONOLITHIC
ORDERS = {SEQUENTIAL: 1, MONOLITHIC: 4}
SIZE = {'chains': 8, 'links': 3}
STEPS = 2e-3, 1e-3, 5e-4, 2.5e-4  # [s]; the claims are about the first two
WEAK = gait(20.0, 0.6)
ADDED_MASS = 1.0  # C_a of a thin plate


def robot(coupling: str, time_step: float, **groups: dict) -> Parameters:
    """Return the parameters of a robot of `SIZE` that takes commands at once, with some more values replaced."""
    solver = {'coupling': coupling, 'time_step': time_step, **groups.pop('solver', {})}
    return without_smoothing(Parameters().replace(**{'fin': SIZE, **groups}, solver=solver))


def followed(
    parameters: Parameters, commands: Commands, lead_in: float, duration: float, start: State | None = None,
    every: int = 1,
) -> History:
    """Command the gaits, advance by `lead_in` [s] and return the history of `duration` [s], each `every` steps."""
    simulator = Simulator(parameters, state=start)
    simulator.command(left=commands[0], right=commands[1])
    simulator.advance(lead_in)
    return recorded(simulator, commands, duration, every)


@dataclasses.dataclass(frozen=True)
class Balance:
    """Energy stored and work done since the first time [J], (T,) each."""

    time: NDArray
    stored: NDArray
    work: dict[str, NDArray]

    @property
    def residual(self) -> NDArray:
        """Signed sum of work that is neither stored nor accounted for, over the rods' whole work."""
        return (self.stored - sum(self.work.values())) / self.work['rods'][-1]


def _balance(parameters: Parameters) -> Balance:
    """Follow half a period of the paper's gait; the work is Simpson's integral of the power at every step."""
    history = followed(parameters, (STRAIGHT, STRAIGHT), 0.2, 0.8)
    stored = sum(energy(parameters, history).values())
    work = {name: cumulative_simpson(values, dx=parameters.solver.time_step, initial=0.0)
            for name, values in power(parameters, history).items()}
    return Balance(history.time, stored - stored[0], work)


def work_and_energy(quick: bool = False) -> Section:
    """Balance the rods' work with what is stored and what the water and the dampers take."""
    steps = STEPS[:2] if quick else STEPS[:3]
    cases = {
        'body held': (MONOLITHIC, {'solver': {'fixed_base': True}}),
        'monolithic': (MONOLITHIC, {}),
        'monolithic with added mass': (MONOLITHIC, {'water': {'added_mass_coefficient': ADDED_MASS}}),
        'sequential': (SEQUENTIAL, {}),
    }
    balances = {name: [_balance(robot(coupling, step, **groups)) for step in steps]
                for name, (coupling, groups) in cases.items()}
    errors = {name: [float(np.abs(run.residual).max()) for run in runs] for name, runs in balances.items()}
    orders = {name: fitted_order(steps[:2], values[:2]) for name, values in errors.items()}
    coarse, fine = (balances['sequential'][index].residual[-1] for index in range(2))
    reference = 'power of forces and motions summed link by link in NumPy'
    fourth = 'fourth order; measured, margin 3 to 5'
    claims = [
        Claim(f'work and energy balance, {name}, step 2 ms', reference, errors[name][0], tolerance, fourth)
        for name, tolerance in (('body held', 1.5e-6), ('monolithic', 2e-7), ('monolithic with added mass', 1e-7))
    ]
    claims += [
        Claim('work and energy balance, sequential, step 2 ms', reference, errors['sequential'][0], 8e-3,
              'first order: the body hears of the wrench a step late; measured, less than 2 of margin'),
        Claim('work and energy balance, sequential, extrapolated to step 0', reference,
              float(abs(2.0 * fine - coarse)), 2e-4, 'second order remains; measured, margin 2.5'),
        Claim('order of the balance, body held', 'order 4 of Runge and Kutta', orders['body held'], (3.5, 4.5),
              'derived: 4; half an order for the kinks of |V.n|'),
        Claim('order of the balance, monolithic', 'order 4 of Runge and Kutta', orders['monolithic'], (3.5, 4.5),
              'derived: 4; half an order for the kinks of |V.n|'),
        Claim('order of the balance, sequential', 'order 1 of forward Euler', orders['sequential'], (0.9, 1.1),
              'derived: 1; second order changes it by less than a tenth'),
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
        right.set_ylabel("residual over the rods' work")

    work = balances['monolithic'][0].work
    return Section(
        'Work and energy', f"""
The robot swims with the paper's gait (A = 40, f = 0.6 Hz, phi = 40 degrees). What the rods put in,
{rounded(work['rods'][-1], 3)} J in {rounded(balances['monolithic'][0].time[-1] - balances['monolithic'][0].time[0])} s,
must be the change of kinetic, elastic and buoyancy energy and what the water ({rounded(-work['drag'][-1], 3)} J) and
the dampers ({rounded(-work['dampers'][-1])} J) take.

The reference shares no code with the simulator. `verification/mechanics.py` takes the reported states, places each link
by the closure of the mechanism, differentiates that exactly, and sums kinetic energy over point masses. Only the wrench
of a fin on its support is the simulator's own: rod power is minus that wrench times the support's motion against the
body. A wrong sign or factor in the wrench, the drag, the springs, the inertia or the coupling thus leaves a residual
that does not fall with the step. Where added mass is on, its force -m_a n (n.a) has a power of its own, which is no
rate of an energy, since n turns; a is the numerical derivative of the midpoints' velocities.

The balance says nothing about the values of the coefficients: it holds for any C_D.
""", tuple(claims), draw,
        'Left: work since the first time, monolithic with added mass, step 2 ms. Right: residual against the step.')


CURRENT = np.array([0.3, -0.2, 0.1])  # [m/s]


def frame_of_reference(quick: bool = False) -> Section:
    """Swim a turn in a current and in still water: the same, seen by one who drifts along."""
    steps = STEPS[:2] if quick else STEPS[:3]
    apart: dict[str, list[float]] = {coupling: [] for coupling in COUPLINGS}
    for coupling in COUPLINGS:
        for step in steps:
            still = robot(coupling, step)
            flowing = still.replace(water={'current': CURRENT})
            carried = dataclasses.replace(State.at_rest(flowing), twist=np.concatenate([CURRENT, np.zeros(3)]))
            one = followed(still, (STRAIGHT, WEAK), 0.0, 2.0, every=50)
            other = followed(flowing, (STRAIGHT, WEAK), 0.0, 2.0, carried, every=50)
            velocities = [np.einsum('tab,tb->ta', to_world(run), run.twist[:, :3]) for run in (one, other)]
            apart[coupling].append(float(max(
                np.abs(other.position - one.position - np.outer(one.time, CURRENT)).max() / np.ptp(one.position),
                np.abs(velocities[1] - velocities[0] - CURRENT).max() / np.abs(velocities[0]).max(),
                np.abs(other.joint_angles - one.joint_angles).max() / np.abs(one.joint_angles).max())))
    orders = {name: fitted_order(steps[:2], values[:2]) for name, values in apart.items()}
    reference = 'the same motion in still water, by Galilei'
    claims = (
        Claim('swimming in a current, monolithic, step 2 ms', reference, apart[MONOLITHIC][0], 2e-10,
              'fourth order; measured, margin 3'),
        Claim('swimming in a current, sequential, step 2 ms', reference, apart[SEQUENTIAL][0], 3e-4,
              'first order: Euler turns the carried velocity with the body; measured, margin 3'),
        Claim('order of the difference, monolithic', 'order 4 of Runge and Kutta', orders[MONOLITHIC], (3.5, 4.7),
              'derived: 4'),
        Claim('order of the difference, sequential', 'order 1 of forward Euler', orders[SEQUENTIAL], (0.85, 1.15),
              'derived: 1'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        draw_convergence(axes, [1e3 * step for step in steps], apart, ORDERS, label='step [ms]')
        axes.set_ylabel('largest difference, relative')

    return Section('A current is a moving frame', f"""
A robot that turns (A 40 and 20 degrees) in a uniform current of {rounded(float(np.linalg.norm(CURRENT)))} m/s, carried
along from the start, must do what it does in still water, seen from a frame that moves with the water. Compared are
position, velocity in the world and all joint angles over 2 s, each over its own range. The body's axes turn meanwhile,
so every product of velocities in the body's and the fins' equations takes part. A current that varies in space or time
is not modeled and not shown.
""", claims, draw, 'Largest difference to the motion in still water.')


CHECKS = work_and_energy, frame_of_reference
