"""How fast the simulator is, beside Pinocchio, MuJoCo, the reference in NumPy and the paper: `make bench`.

One process on one core with single-threaded libraries. All programs run in every round, one after the other, and the
figures are medians over the rounds (of the ratios too, each taken within a round), so a machine that changes its pace
changes it for all of them. Times are this process's processor time: what else the core does between does not count.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import resource
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
from numpy.typing import NDArray

from evidence.benchmark.node_timing import node_figures
from evidence.references import equations
from evidence.references.mujoco_tree import swimmer_model
from evidence.references.pinocchio_tree import swimmer_tree
from manta_sim_ros.dynamics import MONOLITHIC, FinCommand, Parameters, Simulator

GAIT = FinCommand(amplitude=math.radians(40.0), frequency=0.6, phase=math.radians(40.0))
EVALUATIONS = 5  # of both fins in a step: four of Runge-Kutta and the wrench at its end
PAPER_TIME, PAPER_SPAN = 0.18, 0.01  # s, s: Section 4, computing time for this much simulated time
SIZES = {'chains': (8, 16, 30, 60, 120, 240), 'links': (1, 2, 3, 4, 6, 8, 12, 16, 24)}  # the other at its default
SHORT_STEP = 1e-6  # s, stable for the shortest links; a step costs the same whatever its length

Timings = dict[str, NDArray]  # of each contestant, seconds per call in each round


@dataclasses.dataclass(frozen=True)
class Contestant:
    """Something to time: `run(calls)` does it so many times."""

    name: str
    calls: int
    run: Callable[[int], object]


def interleaved(contestants: list[Contestant], rounds: int) -> Timings:
    """Seconds per call of each contestant in each round, after one round that is not counted."""
    seconds: dict[str, list[float]] = {contestant.name: [] for contestant in contestants}
    for _ in range(rounds + 1):
        for contestant in contestants:
            start = time.process_time()
            contestant.run(contestant.calls)
            seconds[contestant.name].append((time.process_time() - start) / contestant.calls)
    return {name: np.array(values[1:]) for name, values in seconds.items()}


def swimming(parameters: Parameters, lead_in: float) -> Simulator:
    """A simulator that has swum straight ahead for `lead_in` [s]."""
    simulator = Simulator(parameters)
    simulator.command(left=GAIT, right=GAIT)
    simulator.advance(lead_in)
    return simulator


def stepper(name: str, simulator: Simulator, parameters: Parameters, steps: int) -> Contestant:
    """Our step: both fins, wrench and body, many of them in one call."""
    return Contestant(name, steps, lambda count: simulator.advance(count * parameters.solver.time_step))


def aba(name: str, tree: pinocchio.Model, convention: pinocchio.Convention, calls: int) -> Contestant:
    """Pinocchio's forward dynamics of a tree, called from a Python loop."""
    random = np.random.default_rng(1)
    data, configuration = tree.createData(), pinocchio.neutral(tree)
    configuration[7:] = random.uniform(-0.5, 0.5, tree.nv - 6)
    velocity, torque = random.uniform(-1.0, 1.0, (2, tree.nv))

    def run(count: int) -> None:
        for _ in range(count):
            pinocchio.aba(tree, data, configuration, velocity, torque, convention)

    return Contestant(name, calls, run)


def mujoco_step(parameters: Parameters, steps: int) -> Contestant:
    """MuJoCo's RK4 step in its own water, looped in C; every round starts from the same bent fins."""
    model = swimmer_model(parameters, parameters.solver.time_step)
    data = mujoco.MjData(model)

    def run(count: int) -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[7:] = 0.1
        mujoco.mj_step(model, data, nstep=count)

    return Contestant('mujoco step', steps, run)


def literal_step(parameters: Parameters, steps: int) -> Contestant:
    """The step of the plain reference: the same scheme, written with 6x6 matrices in NumPy."""
    front = math.asin(parameters.rods.rear_radius / parameters.rods.front_radius * math.sin(GAIT.amplitude))
    amplitudes, phases = np.array([front, GAIT.amplitude]), np.array([GAIT.phase, 0.0])
    pulsation = 2.0 * math.pi * GAIT.frequency

    def rod_motion(side: int, at: float) -> NDArray:
        sine, cosine = np.sin(pulsation * at + phases), np.cos(pulsation * at + phases)
        return np.stack([amplitudes * sine, amplitudes * pulsation * cosine, -amplitudes * pulsation**2 * sine], axis=1)

    def run(count: int) -> None:
        state = equations.rest_state(parameters)
        for _ in range(count):
            state = equations.step(parameters, state, rod_motion)

    return Contestant('literal step', steps, run)


def compare(parameters: Parameters, quick: bool) -> dict[str, float]:
    """Time everyone at the default size; seconds, and ratios to ours (above 1: ours is faster)."""
    tree, least = swimmer_tree(parameters), pinocchio.Model()
    least.addJoint(0, pinocchio.JointModelFreeFlyer(), pinocchio.SE3.Identity(), 'body')
    least.appendBodyToJoint(1, tree.inertias[1], pinocchio.SE3.Identity())
    together = parameters.replace(solver={'coupling': MONOLITHIC})
    heavy = together.replace(water={'added_mass_coefficient': 1.0})
    scale = 1 if quick else 8
    timings = interleaved([
        stepper('our step', swimming(parameters, lead_in=2.0), parameters, 100 * scale),
        stepper('monolithic step', swimming(together, lead_in=2.0), parameters, 100 * scale),
        stepper('monolithic step with added mass', swimming(heavy, lead_in=2.0), parameters, 100 * scale),
        aba('aba local', tree, pinocchio.Convention.LOCAL, 50 * scale),
        aba('aba world', tree, pinocchio.Convention.WORLD, 50 * scale),
        aba('aba of one body', least, pinocchio.Convention.WORLD, 200 * scale),
        mujoco_step(parameters, 10 * scale),
        literal_step(parameters, 1),
    ], rounds=3 if quick else 15)
    ours, call = timings['our step'], timings['aba of one body']
    evaluation = ours / EVALUATIONS
    figures = {
        'our step [s]': ours,
        'monolithic step [s]': timings['monolithic step'],
        'monolithic step with added mass [s]': timings['monolithic step with added mass'],
        'our evaluation [s]': evaluation,
        'aba local [s]': timings['aba local'] - call,
        'aba world [s]': timings['aba world'] - call,
        'aba call overhead, subtracted [s]': call,
        'mujoco step [s]': timings['mujoco step'],
        'literal step [s]': timings['literal step'],
        'aba local / our evaluation': (timings['aba local'] - call) / evaluation,
        'aba world / our evaluation': (timings['aba world'] - call) / evaluation,
        'mujoco step / our step': timings['mujoco step'] / ours,
        'literal step / our step': timings['literal step'] / ours,
        'monolithic step / our step': timings['monolithic step'] / ours,
        'with added mass / our step': timings['monolithic step with added mass'] / ours,
        'ours for the paper span [s]': ours * PAPER_SPAN / parameters.solver.time_step,
        'paper / ours': PAPER_TIME / (ours * PAPER_SPAN / parameters.solver.time_step),
    }
    return {name: float(np.median(values)) for name, values in figures.items()}


def scaling(parameters: Parameters, quantity: str, sizes: tuple[int, ...], quick: bool) -> dict[str, object]:
    """Seconds per step for each size of `fin.<quantity>`; p of time ~ size^p, fitted to all and to the larger half."""
    contestants = []
    for size in sizes:
        sized = parameters.replace(fin={quantity: size}, solver={'time_step': SHORT_STEP})
        contestants.append(stepper(str(size), swimming(sized, lead_in=10 * SHORT_STEP), sized, 50 if quick else 300))
    timings = interleaved(contestants, rounds=3 if quick else 9)
    medians = {size: float(np.median(timings[str(size)])) for size in sizes}
    logarithms = np.log(list(medians.items()))
    exponents = [float(np.polyfit(*part.T, 1)[0]) for part in (logarithms, logarithms[len(sizes) // 2:])]
    return {'step [s]': medians, 'exponent': exponents[0], 'exponent of the larger half': exponents[1]}


def memory(parameters: Parameters, seconds: float) -> dict[str, float]:
    """Resident memory [MiB] before and after `seconds` of simulated swimming, in calls of 0.1 s."""
    simulator = swimming(parameters, lead_in=1.0)
    before = _resident()
    for _ in range(round(seconds / 0.1)):
        simulator.advance(0.1)
    return {'simulated [s]': seconds, 'before [MiB]': before, 'after [MiB]': _resident()}


def _resident() -> float:
    pages = int(Path('/proc/self/statm').read_text(encoding='ascii').split()[1])
    return pages * resource.getpagesize() / 2**20


def _processor() -> str:
    lines = Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
    return next((line.split(':', 1)[1].strip() for line in lines if line.startswith('model name')), 'unknown')


TIMES = {  # figure: what it is
    'our step': 'our step: both fins, RK4, wrench, body',
    'monolithic step': 'our step, monolithic coupling',
    'monolithic step with added mass': 'our step, monolithic, with added mass',
    'our evaluation': f'our evaluation: step / {EVALUATIONS}',
    'aba local': 'Pinocchio aba of the same tree, LOCAL',
    'aba world': 'Pinocchio aba, WORLD, its faster way',
    'aba call overhead, subtracted': 'subtracted there: aba of one body',
    'mujoco step': 'MuJoCo RK4 step with its own drag',
    'literal step': 'literal NumPy step',
}
RATIOS = {  # figure: at least, hoped for
    'aba local / our evaluation': '5, 8',
    'aba world / our evaluation': '5, 8',
    'mujoco step / our step': '4, 6',
    'literal step / our step': '1000',
    'paper / ours': '',
}
COSTS = {  # figure: at most
    'monolithic step / our step': '2',
    'with added mass / our step': '2',
}


def report(figures: dict) -> str:
    """The figures as text."""
    compared, kept = figures['compared'], figures['memory']
    rows = [f'{figures["machine"]}, one core; {figures["size"]}', '', f'{"time":<48}us']
    rows += [f'  {text:<40}{1e6 * compared[f"{name} [s]"]:10.1f}' for name, text in TIMES.items()]
    rows += [f'  for {PAPER_SPAN} s simulated: ours {compared["ours for the paper span [s]"]:.6f} s, '
             f'the paper {PAPER_TIME} s (another machine)']
    rows += ['', f'{"how many times ours is faster":<47}now   goal, hope']
    rows += [f'  {name:<40}{compared[name]:10.1f}   {goal}' for name, goal in RATIOS.items()]
    rows += ['', f'{"how many times as costly as the step":<47}now   at most']
    rows += [f'  {name:<40}{compared[name]:10.2f}   {bound}' for name, bound in COSTS.items()]
    for quantity, cost in figures['cost'].items():
        rows += ['', f'cost of a step: time ~ {quantity}^{cost["exponent"]:.2f}, '
                     f'the larger half ~ {quantity}^{cost["exponent of the larger half"]:.2f}',
                 '  ' + ', '.join(f'{size}: {1e6 * seconds:.1f} us' for size, seconds in cost['step [s]'].items())]
    rows += ['', f'resident memory over {kept["simulated [s]"]:.0f} s of swimming: '
                 f'{kept["before [MiB]"]:.2f} MiB before, {kept["after [MiB]"]:.2f} MiB after']
    node = figures['node']
    rows += ['', f'sim_node: first start to first message {node["first start [s]"]:.1f} s, '
                 f'warm start {node["warm start [s]"]:.2f} s (at most 3), '
                 f'{100.0 * node["processor share"]:.1f} % of a core at 100 Hz (at most 15), '
                 f'{100.0 * node["processor share with markers"]:.1f} % with markers (at most 25)']
    return '\n'.join(rows)


def main() -> None:
    """Measure, print, and write the figures where asked."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument('--quick', action='store_true', help='few rounds and sizes: does it run, not how fast')
    arguments.add_argument('--json', type=Path, metavar='FILE', help='write the figures there too, times in seconds')
    options = arguments.parse_args()
    all_cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(all_cores)})  # the first core serves most interrupts
    parameters = Parameters()
    figures = {
        'machine': _processor(),
        'size': f'{parameters.fin.chains} x {parameters.fin.links} links a fin, step {parameters.solver.time_step} s',
        'compared': compare(parameters, options.quick),
        'memory': memory(parameters, seconds=10.0 if options.quick else 600.0),
        'cost': {quantity: scaling(parameters, quantity, sizes[:3] if options.quick else sizes, options.quick)
                 for quantity, sizes in SIZES.items()},
    }
    os.sched_setaffinity(0, all_cores)  # the node is free to run beside this process
    figures['node'] = node_figures(starts=1, seconds=3.0) if options.quick else node_figures(starts=5, seconds=20.0)
    print(report(figures))
    if options.json:
        options.json.write_text(json.dumps(figures, indent=2) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
