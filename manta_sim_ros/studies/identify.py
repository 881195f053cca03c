"""The command `identify`: parameters of the model from measured runs, and how well the data know them."""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from tqdm import tqdm

from manta_sim_ros.dynamics import DivergenceError, Parameters, compile_kernels, shown, shown_name
from manta_sim_ros.figures.files import whole
from manta_sim_ros.figures.jobs import say
from manta_sim_ros.figures.style import save_png
from manta_sim_ros.nodes.settings import Settings
from manta_sim_ros.studies.arguments import Parser, check_output, read_settings
from manta_sim_ros.studies.bag import RecordingWarning
from manta_sim_ros.studies.design import design
from manta_sim_ros.studies.gaits import ORDER
from manta_sim_ros.studies.identification import (
    CONFIDENCE,
    Fit,
    Identification,
    NotIdentifiableError,
    evaluate,
    identify,
)
from manta_sim_ros.studies.measured import CHANNELS, LONGEST_RUN, ORIENTATIONS, Run, read_run
from manta_sim_ros.studies.replay import value_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNITS = {
    'position': ('m',) * 3, 'orientation': ('rad',) * 3, 'twist': ('m/s',) * 3 + ('rad/s',) * 3,
    'imu_orientation': ('rad',) * 3, 'angular_velocity': ('rad/s',) * 3, 'specific_force': ('m/s^2',) * 3,
    'wrench': ('N',) * 3 + ('N m',) * 3, 'rod_angles': ('rad',) * 4, 'rod_torques': ('N m',) * 4}
"""Units of the errors of each channel."""

TOO_LARGE = 2.0
"""Size of the errors, in standard deviations of the noise, above which the model is said to lack something."""

MOST_GAITS = 1000
"""The most gaits that are proposed at once."""

HARDLY = 0.5
"""Standard error, as a share of the estimate, above which the data hardly say what a value is."""


def parameter_file(result: Identification, settings: Settings) -> str:
    """Return a ROS 2 parameter file with all values of the model, and others of the node if they are no defaults."""
    lines = [f'# Identified, with standard errors: {name} = {value:.6g} +- {error:.2g}'
             for name, value, error in zip(result.names, result.estimates, result.errors, strict=True)]
    defaults = Settings()
    values: dict[str, Any] = {}
    fitted = dataclasses.replace(settings, model=result.parameters)
    for full_name in Settings.quantities():
        group, _, name = full_name.rpartition('.')
        value = fitted.value(full_name)
        if full_name in Parameters.quantities() or value != defaults.value(full_name):
            owner = values.setdefault(group, {}) if group else values
            owner[name] = list(value) if isinstance(value, tuple) else value
    content = yaml.safe_dump({'/**': {'ros__parameters': values}}, sort_keys=False, default_flow_style=None, width=100)
    return '\n'.join([*lines, content])


def report(result: Identification) -> list[str]:
    """Return the lines that say what was found, and how well the data know it."""
    width = max(9, *map(len, result.names))
    lines = [f'{"parameter":{width}} {"before":>10} {"estimate":>10} {"error":>9}  {CONFIDENCE:.0%} interval']
    for name, before, estimate, error, (low, high) in zip(
            result.names, result.before, result.estimates, result.errors, result.intervals, strict=True):
        lines.append(f'{name:{width}} {before:10.4g} {estimate:10.5g} {error:9.2g}  {low:.5g} to {high:.5g}')
    if len(result.names) > 1:
        lines += ['correlations of the errors'] + [
            f'{name:{width}} ' + ' '.join(f'{value:6.2f}' for value in row)
            for name, row in zip(result.names, result.correlations, strict=True)]
    lines.append(f'condition number {result.condition:.3g}; mean square of the weighted errors {result.chi_square:.3g}')
    if result.chi_square > TOO_LARGE ** 2:
        lines.append(f'the errors are {math.sqrt(result.chi_square):.2g} times the noise that the data say: '
                     'the model lacks something, and the intervals are rough')
    if result.mixed:
        lines.append(f'the data hardly tell {result.mixed} apart: fix one of them, or add other gaits (--design)')
    for name, estimate, error in zip(result.names, result.estimates, result.errors, strict=True):
        if error > HARDLY * abs(estimate):
            lines.append(f'the data hardly say what {name} is: its standard error is {error:.2g}')
    return lines


def error_table(title: str, before: Fit, after: Fit) -> list[str]:
    """Return the lines with the errors of each component before and after, and in standard deviations of the noise."""
    lines = [f'{title:38} {"before":>10} {"after":>10}  in deviations of the noise']
    for channel, rms in after.rms.items():
        names = 'xyz' if channel in ORIENTATIONS else CHANNELS[channel]
        for name, unit, old, new, weighted in zip(
                names, UNITS[channel], before.rms[channel], rms, after.weighted[channel], strict=True):
            known = '' if np.isnan(weighted) else f'{weighted:.3g}'
            lines.append(f'{channel:18} {name:>12} {f"[{unit}]":7} {old:10.3g} {new:10.3g}  {known}'.rstrip())
    return lines


def plot(runs: Sequence[Run], before: Fit, after: Fit, path: Path) -> None:
    """Plot measured and simulated values of all runs, before and after, to a PNG file."""
    rows = [(number, channel) for number, run in enumerate(runs) for channel in run.channels]

    def panels(figure: Figure) -> None:
        for row, (number, channel) in zip(figure.subfigures(len(rows), 1, squeeze=False)[:, 0], rows, strict=True):
            series, names = runs[number].channels[channel], CHANNELS[channel]
            row.suptitle(f'{runs[number].name}: {channel}', fontsize='medium')
            for component, axes in enumerate(row.subplots(1, len(names), sharex=True)):
                axes.plot(series.time, series.values[:, component], '.', color='0.6', markersize=2, label='measured')
                for label, fit in (('before', before), ('after', after)):
                    axes.plot(series.time, fit.values[number][channel][:, component], label=label)
                axes.set_title(names[component], fontsize='small')
        axes.legend()

    with whole(path) as part:
        save_png(panels, part, height=1.8 * len(rows), width=12.0)


def main(args: Sequence[str] | None = None) -> None:
    """Run the command; the exit status is 0, 1 if the data do not say what the values are, or 2 for wrong input."""
    parser = _parser()
    options = parser.parse_args(args)
    seen: set[type[Warning]] = set()

    def show(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        if category not in seen or category is RecordingWarning:  # each simulation would give the others again
            tqdm.write(f'{parser.prog}: {message}', sys.stderr)
        seen.add(category)

    with warnings.catch_warnings():
        warnings.showwarning = show
        try:
            inputs = _read(options)
        except (OSError, ValueError) as error:
            parser.error(str(error))
        try:
            _run(options, *inputs)
        except (DivergenceError, NotIdentifiableError, OSError) as error:
            sys.exit(f'{parser.prog}: {error}')
        except ValueError as error:
            parser.error(str(error))


def _read(options: argparse.Namespace) -> tuple[Settings, list[str], list[Run], list[Run]]:
    """Return the settings, the names of the free parameters, the runs, and those for the validation."""
    settings = Settings() if options.config is None else read_settings(options.config)
    names = _names('--free', options.free)
    for number, name in enumerate(names):
        value_of(settings.model, name)
        if name in names[:number]:
            raise ValueError(f'--free has {name} twice')
    _check(options)
    runs, others = ([read_run(path, settings, options.namespace, options.channels.split(',')) for path in paths]
                    for paths in (options.data, options.validate))
    return settings, names, runs, others


def _run(
    options: argparse.Namespace, settings: Settings, names: list[str], runs: list[Run], others: list[Run],
) -> None:
    compile_kernels(settings.model, lambda line: say(line, sys.stderr))
    if options.design:
        _design(options, names, settings.model, runs)
        return
    with tqdm(disable=None, unit='simulation', desc='identify') as bar:
        def done(cost: float) -> None:
            bar.set_postfix_str(f'mean square of the weighted errors {cost:.4g}')
            bar.update()

        result = identify(runs, names, settings.model, segment=options.segment, done=done)
    if options.output is not None:  # at once: nothing that fails later loses it
        with whole(options.output) as part:
            part.write_text(parameter_file(result, settings), encoding='utf-8')
    count = sum(series.values.size for run in runs for series in run.channels.values())
    channels = dict.fromkeys(channel for run in runs for channel in run.channels)
    say(f'{len(runs)} runs, {count} measured values of {", ".join(channels)}')
    say('\n'.join(report(result)))
    before = evaluate(runs, settings.model, segment=options.segment)
    say('\n'.join(error_table('errors, root mean square', before, result.fit)))
    if others:
        fits = [evaluate(others, parameters, segment=options.segment) for parameters in (
            settings.model, result.parameters)]
        say('\n'.join(error_table('validation, root mean square', *fits)))
    if options.plot is not None:
        plot(runs, before, result.fit, options.plot)


def _design(options: argparse.Namespace, names: Sequence[str], model: Parameters, runs: Sequence[Run]) -> None:
    found = design(names, model, options.design, duration=options.duration, runs=runs)
    say(f'gaits from rest, {options.duration:g} s each, the best one first ({ORDER}, biases; degrees, Hz)')
    say('\n'.join(','.join(f'{value:g}' for value in gait) for gait in found.gaits))
    say('expected standard errors')
    say('\n'.join(f'{name}: {error:.2g}, at the value {value:.4g}'
                  for name, value, error in zip(names, found.values, found.errors, strict=True)))


def _check(options: argparse.Namespace) -> None:
    """Refuse arguments that do not go together, before anything is computed."""
    for name in _names('--channels', options.channels):
        if name not in CHANNELS:
            raise ValueError(f'--channels has {shown_name(name)}, but must have names of {", ".join(CHANNELS)}')
    if options.design:
        given = [name for name in ('output', 'plot', 'validate', 'segment') if getattr(options, name)]
        if given:
            raise ValueError(f'--{given[0]} does not go with --design, which proposes gaits')
    elif not options.data:
        raise ValueError('there are no data: name tables or bags')
    for name, suffix in (('output', '.yaml'), ('plot', '.png')):
        path = getattr(options, name)
        if path is not None:
            check_output(f'--{name}', path, suffix, [options.config, *options.data, *options.validate])


def _names(option: str, text: str) -> list[str]:
    """Return the names in a text, or raise a ValueError."""
    names = text.split(',')
    if not all(names):
        raise ValueError(f'{option} is {shown(text)}, but must have a name before and after each comma')
    return names


def _parser() -> Parser:
    parser = Parser(
        prog='identify', description='Fit parameters of the model to measured runs by weighted least squares: '
                                     'estimates, intervals, correlations, and what the data cannot say.')
    parser.add_argument('data', nargs='*', type=Path,
                        help='runs that begin with level fins: tables (CSV) or bags; docs/identify.md has the columns')
    parser.add_argument('--free', required=True, metavar='NAME,NAME...',
                        help='parameters to fit, such as fin.drag_coefficient,body.quadratic_damping[5]')
    parser.add_argument('--config', type=Path, metavar='FILE',
                        help='a ROS 2 parameter file with the values to start from (default: the built-in values)')
    parser.add_argument('--output', type=Path, metavar='FILE.yaml', help='write a parameter file with the estimates')
    parser.add_argument('--plot', type=Path, metavar='FILE.png', help='plot the runs, before and after')
    parser.add_argument('--validate', nargs='+', type=Path, default=[], metavar='DATA',
                        help='other runs, which take no part in the fit: their errors before and after')
    parser.add_argument('--segment', type=_positive(float, LONGEST_RUN), metavar='T',
                        help='divide the runs into segments of T s with starts of their own (default: whole runs)')
    parser.add_argument('--channels', default=','.join(CHANNELS), metavar='NAME,NAME...',
                        help='what is compared with the simulation, as far as it was measured (default: %(default)s)')
    parser.add_argument('--namespace', help='the namespace of the robot in bags with several robots')
    parser.add_argument('--design', nargs='?', type=_positive(int, MOST_GAITS), const=3, metavar='COUNT',
                        help='propose so many gaits that tell most about the parameters (default: 3), and do not fit')
    parser.add_argument('--duration', type=_positive(float, LONGEST_RUN), default=10.0, metavar='T',
                        help='duration of a proposed run [s] (default: 10)')
    return parser


def _positive(kind: type[float] | type[int], most: float) -> Callable[[str], float]:
    def number(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not 0 < value <= most:
            which = 'whole number' if kind is int else 'number'
            raise argparse.ArgumentTypeError(
                f'is {shown(text)}, but must be a {which} above 0 and at most {most:g}')
        return value

    return number
