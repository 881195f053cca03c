"""The diagnostics of the node in words: pace, commands, disturbances, motion, time step and power."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from manta_sim_ros.dynamics import FloatArray
from manta_sim_ros.nodes.refusals import Refused
from manta_sim_ros.nodes.transport import cost_of_transport

OTHER_INPUTS = ('rod_command', 'set_pose', 'initialpose', 'parameters', 'service calls')
"""Beside `fin_command` and the disturbances."""

PACE_TOLERANCE = 0.95
"""Share of the wanted real-time factor from which on the machine keeps up."""


@dataclasses.dataclass(frozen=True)
class Health:
    """The condition of the node now, and since the last diagnostics. Times are simulated ones [s] unless stated."""

    time: float
    paused: bool
    """Whether simulated time stands still."""
    follows: bool
    """Whether the node follows the clock of another one."""
    clock_trouble: str
    """What is wrong with that clock, empty for nothing."""
    wanted_factor: float
    """The wanted real-time factor; 0 is as fast as possible."""
    reached_factor: float
    """The real-time factor reached, NaN when paused, or when the time to measure it was too short."""
    computing: float
    """Computing time of a time step, elapsed time [s], NaN when there was none."""
    commanding_topic: str
    """The topic of the commands that are in force."""
    held: Refused
    """The rod commands that are held where the support still closes."""
    command_age: float
    """Time since the last accepted command, NaN when there was none."""
    timed_out: bool
    """Whether the amplitudes went to zero, or the rods hold, because that was too long ago."""
    abandoned: bool
    """Whether the fins flap although nobody publishes commands any more."""
    refused: Mapping[str, Refused]
    """What was refused of each topic that the simulator subscribes to, of parameters, and of service calls."""
    current: FloatArray
    """Present velocity (3,) of the water, world frame [m/s]."""
    external_wrench: bool
    """Whether a body_wrench acts."""
    diverged_lately: bool
    finite: bool
    """Whether the whole state is finite."""
    body_in_water: float
    fins_in_water: float
    """Shares that are below the surface of the water."""
    time_step: float
    largest_step: float
    """Estimate of the largest stable time step of the present gait."""
    power: float
    """Mean power of the motors of the rods into the fins [W], NaN when simulated time stood still."""
    speed: float
    """Mean forward speed [m/s], NaN when simulated time stood still."""
    weight: float
    """m_b g of the body [N]."""

    @property
    def keeps_up(self) -> bool:
        """Whether simulated time runs as fast as wanted."""
        return self.paused or not self.reached_factor < PACE_TOLERANCE * self.wanted_factor


def statuses(node: str, health: Health) -> list[DiagnosticStatus]:
    """Return the statuses of a node, which is given by its full name."""
    return [
        _status(node, subject, *describe(health))
        for subject, describe in (
            ('pace', _pace), ('commands', _commands), ('disturbances', _disturbances), ('motion', _motion),
            ('time step', _time_step), ('power', _power), ('water', _water))]


Description = tuple[bytes, str, dict[str, str]]
"""Level, message and values."""


def _pace(health: Health) -> Description:
    values = {
        'simulated time [s]': f'{health.time:.3f}', 'real-time factor': _number(health.reached_factor),
        'real-time factor asked for': f'{health.wanted_factor:g}',
        'computing time of a step [us]': _number(1e6 * health.computing),
    }
    if health.clock_trouble:
        return DiagnosticStatus.WARN, health.clock_trouble, values
    if health.paused:
        return DiagnosticStatus.OK, (
            'simulated time stands still, as /clock does' if health.follows
            else 'paused: simulated time stands still'), values
    if math.isnan(health.reached_factor):
        return DiagnosticStatus.OK, 'simulated time runs', values
    if not health.keeps_up:
        return DiagnosticStatus.WARN, (
            f'this machine cannot keep up: simulated time runs at {health.reached_factor:.2g} times real time instead '
            f'of {health.wanted_factor:g}'), values
    return DiagnosticStatus.OK, f'simulated time runs at {health.reached_factor:.2g} times real time', values


def _commands(health: Health) -> Description:
    values = {
        'age of the last fin_command [s]': _number(health.command_age),
        'refused': str(health.refused['fin_command'].total),
        **{f'{name} refused': str(health.refused[name].total) for name in OTHER_INPUTS},
        'rod_command held': str(health.held.total),
    }
    refused = _refused_lately(health, 'fin_command', *OTHER_INPUTS)
    if refused:
        return DiagnosticStatus.WARN, refused, values
    if health.held.lately:
        return DiagnosticStatus.WARN, f'{health.held.lately} rod_command held just now: {health.held.reason}', values
    if health.timed_out:
        instead = 'the rods hold' if health.commanding_topic == 'rod_command' else 'the fins glide to rest'
        return DiagnosticStatus.WARN, (
            f'no {health.commanding_topic} for {health.command_age:.3g} s: {instead}, publish a new command'), values
    if health.abandoned:
        return DiagnosticStatus.WARN, (
            'the fins flap, but nobody publishes fin_command any more: set command_timeout to let them glide to rest'
        ), values
    if math.isnan(health.command_age):
        return DiagnosticStatus.OK, 'no fin_command yet: the fins are at rest', values
    return DiagnosticStatus.OK, f'the last {health.commanding_topic} came {health.command_age:.3g} s ago', values


def _disturbances(health: Health) -> Description:
    speed = float(np.linalg.norm(health.current))
    values = {
        'current [m/s]': ' '.join(f'{component:.3g}' for component in health.current),
        'body_wrench acts': str(health.external_wrench).lower(),
        'disturbances refused': str(sum(health.refused[topic].total for topic in ('current', 'body_wrench'))),
    }
    refused = _refused_lately(health, 'current', 'body_wrench')
    if refused:
        return DiagnosticStatus.WARN, refused, values
    water = f'the water flows at {speed:.2g} m/s' if speed > 0.0 else 'the water is still'
    wrench = 'a body_wrench acts' if health.external_wrench else 'no external wrench acts'
    return DiagnosticStatus.OK, f'{water}, {wrench}', values


def _refused_lately(health: Health, *topics: str) -> str:
    """Return what was refused of these topics since the last diagnostics, with the last reason; empty for nothing."""
    lately = {topic: health.refused[topic] for topic in topics if health.refused[topic].lately}
    return '; '.join(
        f'{refused.lately} {topic} refused just now: {refused.reason}' for topic, refused in lately.items())


def _motion(health: Health) -> Description:
    values = {'finite': str(health.finite).lower()}
    if health.diverged_lately or not health.finite:
        return DiagnosticStatus.ERROR, (
            'the motion diverged and the robot was put at rest: use a smaller solver.time_step, and command it again'
        ), values
    return DiagnosticStatus.OK, 'position, velocity and fins are finite', values


def _time_step(health: Health) -> Description:
    values = {'solver.time_step [s]': f'{health.time_step:g}', 'largest stable [s]': f'{health.largest_step:.2g}'}
    if health.time_step > health.largest_step:
        return DiagnosticStatus.WARN, (
            f'solver.time_step is {health.time_step:g} s, but this gait is stable up to about '
            f'{health.largest_step:.2g} s only: the motion may diverge'), values
    return DiagnosticStatus.OK, 'solver.time_step is small enough for this gait', values


def _power(health: Health) -> Description:
    cost = cost_of_transport(health.power, health.speed, health.weight)
    values = {
        'mean power of the rods [W]': _number(health.power), 'mean forward speed [m/s]': _number(health.speed),
        'cost of transport': _number(cost)}
    if math.isnan(health.power):
        return DiagnosticStatus.OK, 'no simulated time passed', values
    words = f'the motors of the rods give the fins {health.power:.2g} W at {health.speed:.2g} m/s'
    return DiagnosticStatus.OK, words if math.isnan(cost) else f'{words}: cost of transport {cost:.2g}', values


def _water(health: Health) -> Description:
    body, fins = (f'{math.floor(100.0 * share)} %' for share in (health.body_in_water, health.fins_in_water))
    values = {'body in the water': body, 'fins in the water': fins}
    if health.body_in_water == health.fins_in_water == 1.0:
        return DiagnosticStatus.OK, 'under water', values
    if health.body_in_water == health.fins_in_water == 0.0:
        return DiagnosticStatus.WARN, 'in the air: the robot falls', values
    return DiagnosticStatus.OK, f'at the surface: {body} of the body and {fins} of the fins are in the water', values


def _number(value: float) -> str:
    return '-' if math.isnan(value) else f'{value:.3g}'


def _status(node: str, subject: str, level: bytes, message: str, values: dict[str, str]) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=level, name=f'{node}: {subject}', message=message, hardware_id=node,
        values=[KeyValue(key=key, value=value) for key, value in values.items()])
