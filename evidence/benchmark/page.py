"""The page docs/benchmark.md."""

from __future__ import annotations

from typing import Any

from evidence.benchmark import environments
from evidence.benchmark.baselines import (
    CHAINS_OF_MANY,
    CHAINS_OF_WIDE,
    EVALUATIONS,
    PAPER_SPAN,
    PAPER_TIME,
    ROBOTS,
    TWISTED,
)
from evidence.report import prose, table
from manta_sim_ros.dynamics import Parameters

HEAD = """# Benchmark

`make bench` wrote this page. It times the simulator beside other programs in the same run, one after the other in every
round, on one core with single-threaded libraries. Absolute times depend on the machine; the ratios hardly do.
"""
TIMES = {
    'our step': 'our step: both fins, Runge-Kutta, wrench, body',
    'monolithic step': 'our step, monolithic coupling',
    'monolithic step with added mass': 'our step, monolithic coupling, with added mass',
    'our evaluation': f'our evaluation of both fins: step / {EVALUATIONS}',
    'aba local': '`aba` of Pinocchio, the same tree, convention LOCAL',
    'aba world': '`aba` of Pinocchio, the same tree, convention WORLD',
    'aba call overhead, subtracted': '`aba` of one body, which is subtracted from the two above',
    'mujoco step': 'Runge-Kutta step of MuJoCo with its own drag, the same tree',
    'reference step': 'step of the reference implementation in NumPy',
}
RATIOS = {  # least wanted ratio
    'aba local / our evaluation': '5',
    'aba world / our evaluation': '5',
    'mujoco step / our step': '4',
    'reference step / our step': '1000',
    'paper / ours': '',
}
COSTS = {'monolithic step / our step': '2', 'with added mass / our step': '2'}  # greatest wanted ratio
TWIST_COST = '1.2'  # greatest wanted ratio

SHARES = {
    'sim_node': 'processor share',
    'sim_node with markers': 'processor share with markers',
    'a bare node, single-threaded executor': 'processor share of a bare node, single-threaded',
    'a bare node, events executor': 'processor share of a bare node, events',
}

BATCHES = ('advance in turn, one core', 'batch, one core', 'batch, all cores', 'mujoco rollout, all cores')
BATCH_RATIOS = {  # least wanted ratio
    'batch / advance in turn, one core': '', 'all cores / one core': '1.8', 'batch / mujoco rollout': ''}

ROBOTS_OF = ('at 1000 Hz on one core', 'in ten processes', 'in one process')


def text(figures: dict[str, Any]) -> str:
    """Return the page."""
    compared, calls, kept, batches, node, robots = (
        figures[name] for name in ('compared', 'calls', 'memory', 'batches', 'node', 'robots'))
    steps = round(PAPER_SPAN / Parameters().solver.time_step)
    return '\n\n'.join([
        HEAD.strip(),
        prose(f'Machine: {figures["machine"]}. Fins of {figures["size"]}.'),
        '## Time of a step',
        table(('program', 'time [us]'), (
            (name, f'{1e6 * compared[f"{key} [s]"]:.1f}') for key, name in TIMES.items())),
        prose(f"""
The {PAPER_SPAN} s of simulated time that took the paper {PAPER_TIME} s on its machine are {steps} of our steps, which
take {compared["ours for the paper span [s]"]:.6f} s here. A step costs the same whatever its length. It contains
{EVALUATIONS} evaluations of both fins, which are compared with one `aba` of a tree with the same 186 degrees of
freedom; `aba` computes neither drag nor springs."""),
        '## Ratios',
        table(('how many times faster our program is', 'ratio', 'wanted, at least'), (
            (name, f'{compared[name]:.1f}', least) for name, least in RATIOS.items())),
        table(('cost relative to our step', 'ratio', 'wanted, at most'), (
            (name, f'{compared[name]:.2f}', most) for name, most in COSTS.items())),
        '## Stiffness against twist',
        prose('A step with `fin.shear_modulus` above 0, relative to the same step without it.'),
        table(('chains', 'shear modulus [MPa]', 'time without [us]', 'time with [us]', 'ratio', 'wanted, at most'), (
            (str(chains), f'{1e-6 * TWISTED[chains]:g}', f'{1e6 * cost["without [s]"]:.1f}',
             f'{1e6 * cost["with [s]"]:.1f}', f'{cost["with / without"]:.2f}', TWIST_COST)
            for chains, cost in figures['twist'].items())),
        '## Pace of the configurations',
        prose('Straight swimming in the library: simulated time divided by computing time.'),
        table(('configuration', 'chains', 'time step [ms]', 'time of a step [us]', 'times real time'), (
            (f'`config/{name}.yaml`', str(pace['chains']), f'{1e3 * pace["time step [s]"]:g}',
             f'{1e6 * pace["step [s]"]:.1f}', f'{pace["times real time"]:.0f}')
            for name, pace in figures['paces'].items())),
        '## Many robots at once',
        prose(f"""
Robot-steps per elapsed second of {ROBOTS} robots with {CHAINS_OF_MANY} chains. The rollout of MuJoCo is that of the
same trees with its own drag. A robot alone already computes the chains of both fins side by side. On one core a
batch saves only what a step takes beside them. The time of a robot with {CHAINS_OF_WIDE} chains tells what the chains
take: without anything else, a batch would be {batches["most that a batch could gain"]:.2f} times as fast as `advance`
in turn. The 3 times that were wanted at first cannot be reached."""),
        table(('program', 'robot-steps per second'), (
            (name, f'{batches[name]:.0f}') for name in BATCHES)),
        table(('ratio', 'value', 'wanted, at least'), (
            (name, f'{batches[name]:.2f}', least) for name, least in BATCH_RATIOS.items())),
        environments.section(figures['environments']),
        '## Size of the fins',
        *(block for quantity, cost in figures['cost'].items() for block in (
            prose(f'The time of a step grows with the number of {quantity} to the power of {cost["exponent"]:.2f}; '
                  f'over the larger half of the sizes, to the power of {cost["exponent of the larger half"]:.2f}.'),
            table((quantity, 'time of a step [us]'), (
                (str(size), f'{1e6 * seconds:.1f}') for size, seconds in cost['step [s]'].items())))),
        '## Calls from Python',
        table(('call', 'time [us]'), (
            (name.removesuffix(' [s]'), f'{1e6 * seconds:.0f}') for name, seconds in calls.items())),
        prose(f"""
The resident memory is {kept["before [MiB]"]:.1f} MiB before and {kept["after [MiB]"]:.1f} MiB after
{kept["simulated [s]"]:.0f} s of simulated swimming."""),
        '## The node',
        prose("""
A bare node of rclpy has one timer and publishes one `Odometry` at 100 Hz. It runs at the same time as `sim_node`, which
publishes all its topics at that rate. Nobody listens to either of them, unless the row says so."""),
        table(('sim_node', 'value', 'wanted, at most'), (
            ('first start to first message, kernels not compiled [s]', f'{node["first start [s]"]:.1f}', ''),
            ('later start to first message [s]', f'{node["warm start [s]"]:.2f}', '1.2'),
            *((f'share of a core of {name} at 100 Hz [%]', f'{100.0 * node[key]:.1f}', '')
              for name, key in SHARES.items()),
            ('... relative to the bare node, single-threaded', f'{node["ours / bare"]:.2f}', '1.0'),
            ('... with a subscriber of the odometry of each', f'{node["ours / bare, heard"]:.2f}', ''),
            ('... with markers at 10 Hz', f'{node["ours with markers / bare"]:.2f}', '1.5'),
        )),
        prose("""
The pace of swimming robots with all their topics, and the processor time of all their processes together. Of ten
robots, the factor is that of the slowest."""),
        table(('robots', 'real-time factor', 'share of a core [%]'), (
            (name, f'{robots[f"real-time factor {name}"]:.3f}', f'{100.0 * robots[f"processor share {name}"]:.0f}')
            for name in ROBOTS_OF)),
    ]) + '\n'
