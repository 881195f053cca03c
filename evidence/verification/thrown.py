"""Theme 1, laws: momentum and energy of a robot that is thrown with its rods locked, so that nothing drives it."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from evidence.scenarios import WATER_OF_BODY
from evidence.verification.claims import Claim, Section
from evidence.verification.figures import draw_convergence, fitted_order
from evidence.verification.laws import COUPLINGS, ORDERS, SIZE, STEPS, followed, robot
from evidence.verification.mechanics import History, energy, momentum
from manta_sim_ros.dynamics import MONOLITHIC, FinCommand, FloatArray, Parameters, State

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOCKED = (FinCommand(0.0, 0.0, 0.0, front_bias=0.3, rear_bias=0.1), FinCommand(0.0, 0.0, 0.0, -0.1, 0.2))
NO_WATER = {'water': {'density': 0.0}}
ADDED, IMPULSE = 'monolithic with added mass of the body', {'added_mass': WATER_OF_BODY['added_mass']}
NO_DAMPING = {'fin': {**SIZE, 'joint_damping': 0.0}, 'body': {'angular_damping': (0.0, 0.0, 0.0)}}


def _thrown(parameters: Parameters) -> State:
    """Return a random state: a rotated and moving body with bent and moving fins."""
    random = np.random.default_rng(1)
    joints = (2, parameters.fin.chains, parameters.fin.links)
    orientation = random.normal(size=4)
    return dataclasses.replace(
        State.at_rest(parameters), position=random.uniform(-1.0, 1.0, 3),
        orientation=orientation / np.linalg.norm(orientation), twist=random.uniform(-0.5, 0.5, 6),
        joint_angles=random.uniform(-0.2, 0.2, joints), joint_rates=random.uniform(-1.0, 1.0, joints))


def momentum_is_kept(quick: bool = False) -> Section:
    """Throw the robot into empty space, and measure the drift of its momentum about a fixed point."""
    steps = STEPS[1:3] if quick else STEPS[:4]
    cases = {**{name: (coupling, {}) for name, coupling in COUPLINGS.items()}, ADDED: (MONOLITHIC, IMPULSE)}
    drift: dict[str, list[float]] = {name: [] for name in cases}
    for name, (coupling, added) in cases.items():
        for step in steps:
            parameters = robot(
                coupling, step, **NO_WATER, body={'gravity': 0.0, 'angular_damping': (0.0, 0.0, 0.0), **added})
            of_time = momentum(parameters, followed(parameters, LOCKED, 0.02, 0.5, _thrown(parameters)))
            scale = np.repeat(np.linalg.norm(of_time[0].reshape(2, 3), axis=1), 3)  # linear, angular
            drift[name].append(float(np.abs((of_time - of_time[0]) / scale).max()))
    at = steps.index(STEPS[1])
    orders = {name: fitted_order(steps[at:at + 2], values[at:at + 2]) for name, values in drift.items()}
    reference = 'sum of m v and r x m v of point masses in NumPy'
    claims = (
        Claim('drift of momentum without water, monolithic, step 1 ms', reference, drift['monolithic'][at], 2e-7,
              'fourth order; measured with a margin of 3'),
        Claim('drift of the impulse of robot and water, monolithic, step 1 ms', reference + ', and M_A nu',
              drift[ADDED][at], 5e-8, 'fourth order; measured with a margin of 4'),
        Claim('drift of momentum without water, staggered, step 1 ms', reference, drift['staggered'][at], 6e-3,
              'first order; measured with a margin of 2'),
        Claim('order of the drift of momentum, monolithic', 'order 4 of the Runge-Kutta method', orders['monolithic'],
              (3.5, 5.0), 'derived: at least 4'),
        Claim('order of the drift of the impulse, monolithic', 'order 4 of the Runge-Kutta method', orders[ADDED],
              (3.5, 5.0), 'derived: at least 4'),
        Claim('order of the drift of momentum, staggered', 'order 1 of the forward Euler method', orders['staggered'],
              (0.9, 1.1), 'derived: 1'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        drawn = {name: ORDERS[name.partition(' ')[0]] for name in drift}
        draw_convergence(axes, [1e3 * step for step in steps], drift, drawn, label='step [ms]')
        axes.set_ylabel('largest drift of momentum, relative')

    return Section('Momentum', """
Water, gravity and angular damping are switched off. The rods are locked at nonzero angles, and the robot is thrown: its
body rotates, and its fins move. No external wrench acts, so the linear momentum and the angular momentum about a fixed
point must be conserved, whatever the springs and dampers between the links do. The reference is a sum over point
masses, which needs neither an inertia tensor nor a wrench. An action without its reaction between fin and body, such as
in the printed (19), would appear here as a drift. The robot is also thrown with added mass of its body, without drag.
Then the impulse, which is the momentum of the robot and M_A nu of the water, must be conserved. A wrong sign of the
Munk moment would appear here, but not in the balance of energy, since this moment does no work.
""", claims, draw, 'Largest drift of any component in 0.5 s, over the norm of the linear or angular momentum.')


def energy_without_input(quick: bool = False) -> Section:
    """Throw the robot with its rods locked: its energy may only decrease."""
    increases, histories = {}, {}
    for name, coupling in COUPLINGS.items():
        parameters = robot(coupling, 2e-3)
        history = followed(parameters, LOCKED, 0.02, 0.5 if quick else 2.0, _thrown(parameters))
        total = _energy_above_rest(parameters, history)
        increases[name] = float(np.diff(total).max() / total[0])
        histories[f'{name}, in water'] = history.time, total / total[0]
    parameters = robot(MONOLITHIC, STEPS[3], **NO_WATER, **NO_DAMPING)
    history = followed(parameters, LOCKED, 0.02, 0.5, _thrown(parameters))
    total = _energy_above_rest(parameters, history)
    drift = float(np.abs(total / total[0] - 1.0).max())
    histories['monolithic, no water, no damping'] = history.time, total / total[0]
    reference = 'kinetic, elastic and buoyancy energy in NumPy'
    claims = (
        *(Claim(f'largest increase of energy in a step, rods locked, {name}', reference, increase, 0.0,
                'derived: drag and dampers only absorb energy') for name, increase in increases.items()),
        Claim('drift of energy without water and damping, monolithic, step 0.25 ms', reference, drift, 3e-5,
              'dissipation of the Runge-Kutta method, of fifth order in step times frequency; measured with a margin '
              'of 2.5'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for style, (name, (time, share)) in zip(('-', '--', '-'), histories.items(), strict=True):
            axes.plot(time, share, style, label=name)
        axes.set(xlabel='time [s]', ylabel='energy over initial energy')
        axes.legend()

    return Section('Energy without input', """
The rods are locked and there is no current, so nothing adds energy. In water, with the default parameters, the energy
must decrease in every step. Without water and without damping it must stay constant. The energy of buoyancy is counted
from its least value, which is that of the upright body.
""", claims, draw, 'Energy of the thrown robot over its initial energy.')


def _energy_above_rest(parameters: Parameters, history: History) -> FloatArray:
    body = parameters.body
    least = -body.mass * body.gravity * float(np.linalg.norm(body.buoyancy_center))
    return sum(energy(parameters, history).values()) - least


CHECKS = momentum_is_kept, energy_without_input
