"""Theme 1, laws: momentum and energy of a robot that is thrown, its rods held: nothing is put in."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evidence.verification.claims import Claim, Section
from evidence.verification.figures import draw_convergence, fitted_order
from evidence.verification.laws import COUPLINGS, ORDERS, SIZE, STEPS, followed, robot
from evidence.verification.mechanics import History, energy, momentum
from manta_sim_ros.dynamics import MONOLITHIC, SEQUENTIAL, FinCommand, Parameters, State

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HELD = (FinCommand(0.0, 0.0, 0.0, front_bias=0.3, rear_bias=0.1), FinCommand(0.0, 0.0, 0.0, -0.1, 0.2))
NO_WATER = {'water': {'density': 0.0}}
NO_DAMPING = {'fin': {**SIZE, 'joint_damping': 0.0}, 'body': {'angular_damping': (0.0, 0.0, 0.0)}}


def _thrown(parameters: Parameters) -> State:
    """Return a state in the middle of things: turned, moving, with bent and moving fins."""
    random = np.random.default_rng(1)
    joints = (2, parameters.fin.chains, parameters.fin.links)
    orientation = random.normal(size=4)
    return dataclasses.replace(
        State.at_rest(parameters), position=random.uniform(-1.0, 1.0, 3),
        orientation=orientation / np.linalg.norm(orientation), twist=random.uniform(-0.5, 0.5, 6),
        joint_angles=random.uniform(-0.2, 0.2, joints), joint_rates=random.uniform(-1.0, 1.0, joints))


def momentum_is_kept(quick: bool = False) -> Section:
    """Throw the robot into empty space and follow its momentum about a fixed point."""
    steps = STEPS[1:3] if quick else STEPS[:4]
    drift: dict[str, list[float]] = {coupling: [] for coupling in COUPLINGS}
    for coupling in COUPLINGS:
        for step in steps:
            parameters = robot(
                coupling, step, **NO_WATER, body={'gravity': 0.0, 'angular_damping': (0.0, 0.0, 0.0)})
            of_time = momentum(parameters, followed(parameters, HELD, 0.02, 0.5, _thrown(parameters)))
            scale = np.repeat(np.linalg.norm(of_time[0].reshape(2, 3), axis=1), 3)  # linear, angular
            drift[coupling].append(float(np.abs((of_time - of_time[0]) / scale).max()))
    at = steps.index(STEPS[1])
    orders = {name: fitted_order(steps[at:at + 2], values[at:at + 2]) for name, values in drift.items()}
    reference = 'sum of m v and r x m v of point masses in NumPy'
    claims = (
        Claim('momentum without water, monolithic, step 1 ms', reference, drift[MONOLITHIC][at], 2e-7,
              'fourth order; measured, margin 3'),
        Claim('momentum without water, sequential, step 1 ms', reference, drift[SEQUENTIAL][at], 6e-3,
              'first order; measured, margin 2'),
        Claim('order of the drift of momentum, monolithic', 'order 4 of Runge and Kutta', orders[MONOLITHIC],
              (3.5, 5.0), 'derived: at least 4'),
        Claim('order of the drift of momentum, sequential', 'order 1 of forward Euler', orders[SEQUENTIAL],
              (0.9, 1.1), 'derived: 1'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        draw_convergence(axes, [1e3 * step for step in steps], drift, ORDERS, label='step [ms]')
        axes.set_ylabel('largest drift of momentum, relative')

    return Section('Momentum', """
Water, gravity and angular damping off, rods held at bent positions, the robot thrown with moving fins and turning:
nothing acts from outside, so the linear momentum and the angular momentum about a fixed point must not change, whatever
the springs and dampers between the links do. The reference sums over point masses; it needs no inertia tensor and no
wrench. An action without its reaction between fin and body, as in the print's (19), shows here.
""", claims, draw, 'Largest drift of any component in 0.5 s, over the norm of the linear or angular momentum.')


def energy_without_input(quick: bool = False) -> Section:
    """Let the thrown robot go with its rods held: its energy may only fall."""
    rises, histories = {}, {}
    for coupling in COUPLINGS:
        parameters = robot(coupling, 2e-3)
        history = followed(parameters, HELD, 0.02, 0.5 if quick else 2.0, _thrown(parameters))
        total = _energy_above_rest(parameters, history)
        rises[coupling] = float(np.diff(total).max() / total[0])
        histories[f'{coupling}, in water'] = history.time, total / total[0]
    parameters = robot(MONOLITHIC, STEPS[3], **NO_WATER, **NO_DAMPING)
    history = followed(parameters, HELD, 0.02, 0.5, _thrown(parameters))
    total = _energy_above_rest(parameters, history)
    kept = float(np.abs(total / total[0] - 1.0).max())
    histories['monolithic, no water, no damping'] = history.time, total / total[0]
    reference = 'kinetic, elastic and buoyancy energy in NumPy'
    claims = (
        *(Claim(f'largest rise of energy in a step, rods held, {coupling}', reference, rise, 0.0,
                'the second law: drag and dampers only take') for coupling, rise in rises.items()),
        Claim('energy without water and damping, monolithic, step 0.25 ms', reference, kept, 3e-5,
              "Runge-Kutta's own loss, of fifth order in step times frequency; measured, margin 2.5"),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for name, (time, share) in histories.items():
            axes.plot(time, share, '--' if MONOLITHIC in name and 'no' not in name else '-', label=name)
        axes.set(xlabel='time [s]', ylabel='energy over that at the start')
        axes.legend()

    return Section('Energy never grows by itself', """
Rods held, no current: nothing puts energy in. In water, with the defaults, it must fall in every single step; without
water and without damping it must stay. Buoyancy's energy counts from its least, upright.
""", claims, draw, 'Energy of the thrown robot, over that at the start.')


def _energy_above_rest(parameters: Parameters, history: History) -> NDArray:
    body = parameters.body
    least = -body.mass * body.gravity * float(np.linalg.norm(body.buoyancy_center))
    return sum(energy(parameters, history).values()) - least


CHECKS = momentum_is_kept, energy_without_input
