"""The curves of a swim over time, for the page and for print."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid
from scipy.spatial.transform import Rotation

from manta_sim_ros.dynamics import SIDES, FloatArray
from manta_sim_ros.nodes.transport import cost_of_transport
from manta_sim_ros.studies.recorded_swim import Swim

WINDOW = 2.0
"""Time over which power and speed are averaged [s]: longer than a beat of the prototype, 1.7 s."""

Curve = tuple[FloatArray, FloatArray]
"""Times (N,) [s] and values (N,)."""


class Panel(NamedTuple):
    """Curves that share an axis."""

    title: str
    unit: str
    curves: dict[str, Curve]
    """By their names."""
    holds: bool = False
    """Whether a value holds until the next one."""


def panels(swim: Swim) -> list[Panel]:
    """Return the panels of a swim, without those of which the bag has nothing."""
    attitude = np.degrees(np.unwrap(Rotation.from_quat(swim.orientation).as_euler('ZYX'), axis=0))[:, ::-1]
    found = [
        _panel('Velocity', 'm/s', swim.time, swim.twist[:, :3], ('forward', 'left', 'up')),
        _panel('Attitude', 'deg', swim.time, attitude, ('roll', 'pitch', 'yaw')),
        _panel('Position', 'm', swim.time, swim.position, 'xyz'),
        _panel('Force of the fins', 'N', swim.wrench_time, swim.wrench[:, :3], ('forward', 'left', 'up')),
        _panel('Moment of the fins', 'N m', swim.wrench_time, swim.wrench[:, 3:], ('roll', 'pitch', 'yaw')),
    ]
    joints = swim.joints
    if joints is not None:
        rods = [f'{side} {rod}' for side in SIDES for rod in ('front', 'rear')]
        found += [
            _panel('Rods', 'deg', joints.time, np.degrees(joints.rod_angles).reshape(-1, 4), rods),
            _panel('Torque of the rods', 'N m', joints.time, joints.rod_torques.reshape(-1, 4), rods),
        ]
        if joints.joint_angles is not None:
            tips = np.degrees(joints.joint_angles.sum(axis=-1))[..., [0, -1]]
            found.append(_panel(
                'Tips of the first and the last chain', 'deg', joints.time, tips.reshape(-1, 4),
                [f'{side} {chain}' for side in SIDES for chain in ('first', 'last')]))
        power = moving_mean(joints.time, joints.power)
        speed = np.interp(joints.time, swim.time, moving_mean(swim.time, swim.twist[:, 0]))
        body = swim.settings.model.body
        cost = [cost_of_transport(*each, body.mass * body.gravity) for each in zip(power, speed, strict=True)]
        found += [
            Panel('Power of the rods', 'W', {
                'now': (joints.time, joints.power), f'mean of {WINDOW:g} s': (joints.time, power)}),
            Panel('Cost of transport', '', {f'mean of {WINDOW:g} s': (joints.time, np.array(cost))}),
        ]
    if len(swim.gait_time):
        time = np.append(swim.gait_time, swim.time[-1])
        gaits = np.vstack([swim.gaits, swim.gaits[-1:]])
        found += [
            _panel('Commanded angles', 'deg', time, np.degrees(gaits[:, [0, 1, 4, 5]]),
                   [f'{value} {side}' for value in ('A', 'phi') for side in SIDES], holds=True),
            _panel('Commanded frequency', 'Hz', time, gaits[:, 2:4], SIDES, holds=True),
        ]
    return [panel for panel in found if all(len(time) for time, _ in panel.curves.values())]


def moving_mean(time: FloatArray, values: FloatArray) -> FloatArray:
    """Return the mean of values (N,) over the last `WINDOW`, at the beginning over what there is; NaN at the first."""
    integral = cumulative_trapezoid(values, time, initial=0.0)
    begin = np.maximum(time - WINDOW, time[0])
    with np.errstate(invalid='ignore'):  # 0 / 0
        return (integral - np.interp(begin, time, integral)) / (time - begin)


def facts(swim: Swim) -> dict[str, str]:
    """Return numbers of the whole swim with their units, by their names."""
    duration = swim.time[-1] - swim.time[0]
    speed = float(trapezoid(swim.twist[:, 0], swim.time) / duration)
    found = {
        'Duration': f'{duration:.2f} s',
        'Length of the path': f'{np.linalg.norm(np.diff(swim.position, axis=0), axis=1).sum():.2f} m',
        'Mean forward speed': f'{speed:.3f} m/s',
    }
    if swim.joints is not None and len(swim.joints.time) > 1:
        joints, body = swim.joints, swim.settings.model.body
        power = float(trapezoid(joints.power, joints.time) / (joints.time[-1] - joints.time[0]))
        found |= {'Mean power': f'{power:.2f} W',
                  'Cost of transport': f'{cost_of_transport(power, speed, body.mass * body.gravity):.3f}'}
    return found


def _panel(
    title: str, unit: str, time: FloatArray, values: FloatArray, names: Sequence[str], *, holds: bool = False,
) -> Panel:
    return Panel(title, unit, {
        name: (time, column) for name, column in zip(names, values.T, strict=True)}, holds)
