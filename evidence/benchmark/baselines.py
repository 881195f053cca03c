"""The programs that are timed: our step beside those of Pinocchio, MuJoCo and the reference implementation.

All programs run in every round, one after the other, and the figures are medians over the rounds (of the ratios too,
each taken within a round), so that a machine that changes its pace changes it for all of them. Times are the processor
time of this process, so that other processes on the core do not count.
"""

from __future__ import annotations

import dataclasses
import math
import os
import resource
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
from mujoco import rollout

from evidence.references import equations
from evidence.references.mujoco_tree import swimmer_model
from evidence.references.pinocchio_tree import swimmer_tree
from manta_sim_ros.dynamics import MONOLITHIC, FinCommand, FloatArray, Parameters, Simulator, simulate_batch

GAIT = FinCommand(amplitude=math.radians(40.0), frequency=0.6, phase=math.radians(40.0))
EVALUATIONS = 5  # of both fins in a step: four of Runge-Kutta and the wrench at its end
PAPER_TIME, PAPER_SPAN = 0.18, 0.01  # s, s: Section 4, computing time for this much simulated time
SIZES = {'chains': (8, 16, 30, 60, 120, 240), 'links': (1, 2, 3, 4, 6, 8, 12, 16, 24)}  # the other at its default
TWISTED = {8: 3.8e6, 12: 3.8e6, 30: 4e5}  # Pa, shear modulus for each number of chains: stable with the default step
CONFIG = Path(__file__).parents[2] / 'config'
CONFIGURATIONS = ('manta', 'freshwater')  # files in config/
ROBOTS, CHAINS_OF_MANY = 64, 12  # simulated together; chains of each of their fins
CHAINS_OF_WIDE = 8 * CHAINS_OF_MANY  # of one robot with as many chains as eight of the others
SHORT_STEP = 1e-6  # s, stable for the shortest links; a step costs the same whatever its length

Timings = dict[str, FloatArray]  # of each program, seconds per call in each round


@dataclasses.dataclass(frozen=True)
class Program:
    """Something to time: `run(calls)` does it so many times."""

    name: str
    calls: int
    run: Callable[[int], object]


def interleaved(programs: list[Program], rounds: int) -> Timings:
    """Return the seconds per call of each program in each round, after one round that is not counted."""
    seconds: dict[str, list[float]] = {program.name: [] for program in programs}
    for _ in range(rounds + 1):
        for program in programs:
            start = time.process_time()
            program.run(program.calls)
            seconds[program.name].append((time.process_time() - start) / program.calls)
    return {name: np.array(values[1:]) for name, values in seconds.items()}


def swimming(parameters: Parameters, lead_in: float) -> Simulator:
    """Return a simulator after it swam straight ahead for `lead_in` [s]."""
    simulator = Simulator(parameters)
    simulator.command(left=GAIT, right=GAIT)
    simulator.advance(lead_in)
    return simulator


def stepper(name: str, simulator: Simulator, parameters: Parameters, steps: int) -> Program:
    """Return our step: both fins, wrench and body, many of them in one call."""
    return Program(name, steps, lambda count: simulator.advance(count * parameters.solver.time_step))


def aba(name: str, tree: pinocchio.Model, convention: pinocchio.Convention, calls: int) -> Program:
    """Return the forward dynamics of a tree by Pinocchio, called from a Python loop."""
    random = np.random.default_rng(1)
    data, configuration = tree.createData(), pinocchio.neutral(tree)
    configuration[7:] = random.uniform(-0.5, 0.5, tree.nv - 6)
    velocity, torque = random.uniform(-1.0, 1.0, (2, tree.nv))

    def run(count: int) -> None:
        for _ in range(count):
            pinocchio.aba(tree, data, configuration, velocity, torque, convention)

    return Program(name, calls, run)


def mujoco_step(parameters: Parameters, steps: int) -> Program:
    """Return the RK4 step of MuJoCo with its own drag, looped in C; every round starts from the same bent fins."""
    model = swimmer_model(parameters, parameters.solver.time_step)
    data = mujoco.MjData(model)

    def run(count: int) -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[7:] = 0.1
        mujoco.mj_step(model, data, nstep=count)

    return Program('mujoco step', steps, run)


def reference_step(parameters: Parameters, steps: int) -> Program:
    """Return the step of the reference implementation: the same scheme with 6 x 6 matrices in NumPy."""
    front = math.asin(parameters.rods.rear_radius / parameters.rods.front_radius * math.sin(GAIT.amplitude))
    amplitudes, phases = np.array([front, GAIT.amplitude]), np.array([GAIT.phase, 0.0])
    pulsation = 2.0 * math.pi * GAIT.frequency

    def rod_motion(side: int, at: float) -> FloatArray:
        sine, cosine = np.sin(pulsation * at + phases), np.cos(pulsation * at + phases)
        return np.stack([amplitudes * sine, amplitudes * pulsation * cosine, -amplitudes * pulsation**2 * sine], axis=1)

    def run(count: int) -> None:
        state = equations.rest_state(parameters)
        for _ in range(count):
            state = equations.step(parameters, state, rod_motion)

    return Program('reference step', steps, run)


def compare(parameters: Parameters, quick: bool) -> dict[str, float]:
    """Time all programs at the default size; return seconds, and ratios to ours (above 1: ours is faster)."""
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
        reference_step(parameters, 1),
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
        'reference step [s]': timings['reference step'],
        'aba local / our evaluation': (timings['aba local'] - call) / evaluation,
        'aba world / our evaluation': (timings['aba world'] - call) / evaluation,
        'mujoco step / our step': timings['mujoco step'] / ours,
        'reference step / our step': timings['reference step'] / ours,
        'monolithic step / our step': timings['monolithic step'] / ours,
        'with added mass / our step': timings['monolithic step with added mass'] / ours,
        'ours for the paper span [s]': ours * PAPER_SPAN / parameters.solver.time_step,
        'paper / ours': PAPER_TIME / (ours * PAPER_SPAN / parameters.solver.time_step),
    }
    return {name: float(np.median(values)) for name, values in figures.items()}


def twist(parameters: Parameters, quick: bool) -> dict[int, dict[str, float]]:
    """Return, for each number of chains, seconds per step without and with stiffness against twist, and their ratio."""
    programs = []
    for chains, shear_modulus in TWISTED.items():
        plain = parameters.replace(fin={'chains': chains})
        twisted = plain.replace(fin={'shear_modulus': shear_modulus})
        programs += [stepper(f'{chains} {name}', swimming(each, lead_in=2.0), each, 100 if quick else 800)
                     for name, each in (('without', plain), ('with', twisted))]
    timings = interleaved(programs, rounds=3 if quick else 25)
    return {chains: {
        'without [s]': float(np.median(timings[f'{chains} without'])),
        'with [s]': float(np.median(timings[f'{chains} with'])),
        'with / without': float(np.median(timings[f'{chains} with'] / timings[f'{chains} without'])),
    } for chains in TWISTED}


def paces(quick: bool) -> dict[str, dict[str, float]]:
    """Return, for each configuration, chains, time step [s], seconds per step, and simulated over computing time."""
    files = {name: Parameters.from_yaml(CONFIG / f'{name}.yaml') for name in CONFIGURATIONS}
    timings = interleaved([
        stepper(name, swimming(each, lead_in=2.0), each, 100 if quick else 800) for name, each in files.items()
    ], rounds=3 if quick else 15)
    return {name: {
        'chains': each.fin.chains, 'time step [s]': each.solver.time_step, 'step [s]': float(np.median(timings[name])),
        'times real time': float(np.median(each.solver.time_step / timings[name])),
    } for name, each in files.items()}


def scaling(parameters: Parameters, quantity: str, sizes: tuple[int, ...], quick: bool) -> dict[str, object]:
    """Return seconds per step for each size of `fin.<quantity>`, and p of time ~ size^p for all and the larger half."""
    programs = []
    for size in sizes:
        sized = parameters.replace(fin={quantity: size}, solver={'time_step': SHORT_STEP})
        programs.append(stepper(str(size), swimming(sized, lead_in=10 * SHORT_STEP), sized, 50 if quick else 300))
    timings = interleaved(programs, rounds=3 if quick else 9)
    medians = {size: float(np.median(timings[str(size)])) for size in sizes}
    logarithms = np.log(list(medians.items()))
    exponents = [float(np.polyfit(*part.T, 1)[0]) for part in (logarithms, logarithms[len(sizes) // 2:])]
    return {'step [s]': medians, 'exponent': exponents[0], 'exponent of the larger half': exponents[1]}


def batches(quick: bool) -> dict[str, float]:
    """Return the robot-steps per second of many small robots, in elapsed time, and their ratios.

    Programs: `advance` of each robot in turn on one core, `simulate_batch` on one and on all cores, and MuJoCo's
    threaded rollout of the same trees on all cores. One robot with the chains of many tells what the chains alone take,
    and so how much a batch could gain if nothing else took time.
    """
    parameters = Parameters().replace(fin={'chains': CHAINS_OF_MANY})
    cores = sorted(os.sched_getaffinity(0))
    simulators = [swimming(parameters, lead_in=2.0) for _ in range(ROBOTS)]
    states, steps = [simulator.state for simulator in simulators], 100 if quick else 500
    duration = steps * parameters.solver.time_step
    model = swimmer_model(parameters, parameters.solver.time_step)
    bent = mujoco.MjData(model)
    bent.qpos[7:] = 0.1
    start = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, bent, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    starts = np.tile(start, (ROBOTS, 1))
    mujoco_steps, threads = max(1, steps // 20), [mujoco.MjData(model) for _ in cores]

    wide = swimming(parameters.replace(fin={'chains': CHAINS_OF_WIDE}), lead_in=2.0)

    def in_turn() -> None:
        for simulator in simulators:
            simulator.advance(duration)

    with rollout.Rollout(nthread=len(cores)) as pool:
        programs: dict[str, tuple[list[int], int, Callable[[], object]]] = {
            'advance in turn, one core': (cores[-1:], ROBOTS * steps, in_turn),
            'advance of one wide robot, one core': (cores[-1:], 4 * steps, lambda: wide.advance(4 * duration)),
            'batch, one core': (cores[-1:], ROBOTS * steps, lambda: simulate_batch(parameters, states, None, duration)),
            'batch, all cores': (cores, ROBOTS * steps, lambda: simulate_batch(parameters, states, None, duration)),
            'mujoco rollout, all cores': (
                cores, ROBOTS * mujoco_steps, lambda: pool.rollout(model, threads, starts, nstep=mujoco_steps)),
        }
        rates: dict[str, list[float]] = {name: [] for name in programs}
        for _ in range(3 if quick else 9):
            for name, (used, count, run) in programs.items():
                os.sched_setaffinity(0, used)
                began = time.monotonic()
                run()
                rates[name].append(count / (time.monotonic() - began))
    os.sched_setaffinity(0, cores)
    of = {name: np.array(values[1:]) for name, values in rates.items()}
    small, large = 1.0 / of['advance in turn, one core'], 1.0 / of['advance of one wide robot, one core']
    chains_alone = (large - small) * CHAINS_OF_MANY / (CHAINS_OF_WIDE - CHAINS_OF_MANY)
    figures = of | {
        'most that a batch could gain': small / chains_alone,
        'batch / advance in turn, one core': of['batch, one core'] / of['advance in turn, one core'],
        'all cores / one core': of['batch, all cores'] / of['batch, one core'],
        'batch / mujoco rollout': of['batch, all cores'] / of['mujoco rollout, all cores'],
    }
    return {name: float(np.median(values)) for name, values in figures.items()}


def calls(parameters: Parameters, quick: bool) -> dict[str, float]:
    """Return the seconds of a call from Python: of `advance` over one step and over 0.01 s, and of `command`."""
    simulator, count = swimming(parameters, lead_in=2.0), 100 if quick else 1000

    def repeated(call: Callable[[], object]) -> Callable[[int], None]:
        def run(number: int) -> None:
            for _ in range(number):
                call()
        return run

    timings = interleaved([
        Program('advance, one step [s]', count, repeated(lambda: simulator.advance(parameters.solver.time_step))),
        Program('advance, 0.01 s [s]', count, repeated(lambda: simulator.advance(0.01))),
        Program('command [s]', count, repeated(lambda: simulator.command(left=GAIT, right=GAIT))),
    ], rounds=3 if quick else 9)
    return {name: float(np.median(values)) for name, values in timings.items()}


def memory(parameters: Parameters, seconds: float) -> dict[str, float]:
    """Return the resident memory [MiB] before and after `seconds` of simulated swimming, in calls of 0.1 s."""
    simulator = swimming(parameters, lead_in=1.0)
    before = _resident()
    for _ in range(round(seconds / 0.1)):
        simulator.advance(0.1)
    return {'simulated [s]': seconds, 'before [MiB]': before, 'after [MiB]': _resident()}


def _resident() -> float:
    pages = int(Path('/proc/self/statm').read_text(encoding='ascii').split()[1])
    return pages * resource.getpagesize() / 2**20
