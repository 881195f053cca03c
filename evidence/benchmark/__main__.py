"""Time the simulator beside other programs, and write docs/benchmark.md: `make bench`."""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

from evidence.benchmark import page
from evidence.benchmark.baselines import SIZES, batches, calls, compare, memory, paces, scaling, twist
from evidence.benchmark.environments import environments
from evidence.benchmark.node_timing import node_figures, pace_figures
from manta_sim_ros.dynamics import Parameters

PAGE = Path(__file__).parents[2] / 'docs' / 'benchmark.md'


def main() -> None:
    """Measure, print and write the page."""
    arguments = argparse.ArgumentParser(prog='python -m evidence.benchmark', description=__doc__)
    arguments.add_argument(
        '--quick', action='store_true', help='few rounds and sizes, no page: shows that it runs, not how fast')
    arguments.add_argument('--json', type=Path, metavar='FILE', help='also write the figures, times in seconds')
    options = arguments.parse_args()
    all_cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(all_cores)})  # the first core serves most interrupts
    parameters = Parameters()
    figures = {
        'machine': processor(),
        'size': f'{parameters.fin.chains} chains of {parameters.fin.links} links, time step '
                f'{parameters.solver.time_step} s',
        'compared': compare(parameters, options.quick),
        'twist': twist(parameters, options.quick),
        'paces': paces(options.quick),
        'calls': calls(parameters, options.quick),
        'memory': memory(parameters, seconds=10.0 if options.quick else 600.0),
        'cost': {quantity: scaling(parameters, quantity, sizes[:3] if options.quick else sizes, options.quick)
                 for quantity, sizes in SIZES.items()},
    }
    os.sched_setaffinity(0, all_cores)  # the node runs beside this process
    figures['batches'] = batches(options.quick)
    figures['environments'] = environments(options.quick)
    figures['node'] = node_figures(starts=1, seconds=3.0) if options.quick else node_figures(starts=5, seconds=60.0)
    figures['robots'] = pace_figures(seconds=2.0 if options.quick else 20.0)
    text = page.text(figures)
    print(text)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=2) + '\n', encoding='utf-8')
    if not options.quick:
        PAGE.write_text(text, encoding='utf-8')
        print('written: docs/benchmark.md')


def processor() -> str:
    """Return the name of the processor and the number of its cores."""
    lines = Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
    name = next((line.split(':', 1)[1].strip() for line in lines if line.startswith('model name')), 'unknown')
    return f'{name}, {os.cpu_count()} cores'


if __name__ == '__main__':
    main()
