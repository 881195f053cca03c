"""A swim as it was recorded in a bag, by `simulate` or from the running node."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np

from manta_sim_ros.dynamics import SIDES, FloatArray
from manta_sim_ros.nodes.settings import Settings
from manta_sim_ros.studies.bag import BagReader

RODS = tuple(f'{side}_{rod}_rod' for side in SIDES for rod in ('front', 'rear'))
"""Names of the rods in joint states, in the order of `State.rod_angles`."""

UNIT_TOLERANCE = 0.01
"""Largest difference of the norm of a measured quaternion from 1."""

CHAIN_JOINT = re.compile(r'(left|right)_chain_(\d+)_joint_(\d+)')
"""The name of a joint of a chain in joint states."""

FINS = tuple(f'{side}_fin' for side in SIDES)
"""Namespaces of the fins in the markers."""


@dataclasses.dataclass(frozen=True)
class Joints:
    """What `joint_states` say: T states."""

    time: FloatArray
    """(T,) [s]."""
    rod_angles: FloatArray
    """(T, 2, 2) by fin and rod (front, rear) [rad]."""
    rod_rates: FloatArray
    """(T, 2, 2) [rad/s]."""
    rod_torques: FloatArray
    """(T, 2, 2) [N m]."""
    joint_angles: FloatArray | None
    """(T, 2, n, m) by fin, chain and joint [rad]; None where only the rods were published."""

    @property
    def power(self) -> FloatArray:
        """(T,) power of the motors of all rods [W]."""
        return np.sum(self.rod_rates * self.rod_torques, axis=(1, 2))


@dataclasses.dataclass(frozen=True)
class FinMarkers:
    """The triangles of both fins, with the panels between motors and supports, in `fin_markers`: T states."""

    time: FloatArray
    """(T,) [s]."""
    corners: FloatArray
    """(T, 2, 3 k, 3) by fin, corner and coordinate, body frame [m]; three consecutive corners are a triangle."""


@dataclasses.dataclass(frozen=True)
class Swim:
    """The motion of one robot: T states. Times are those of the stamps, from the first one on if that is no clock's."""

    settings: Settings
    """The parameters with which it was made, as far as they are known."""
    time: FloatArray
    """(T,) [s]."""
    position: FloatArray
    """(T, 3) world frame [m]."""
    orientation: FloatArray
    """(T, 4) unit quaternions x, y, z, w."""
    twist: FloatArray
    """(T, 6) body frame [m/s, rad/s]."""
    wrench_time: FloatArray
    """(W,) [s]."""
    wrench: FloatArray
    """(W, 6) of both fins on the body about its center of mass, body frame [N, N m]."""
    joints: Joints | None
    """None where there are no `joint_states`."""
    markers: FinMarkers | None
    """None where there are no `fin_markers`."""
    gait_time: FloatArray
    """(G,) times from which commands acted [s]."""
    gaits: FloatArray
    """(G, 6) `[A_l, A_r, f_l, f_r, phi_l, phi_r]` [rad, Hz, rad], without biases."""


def read_swim(path: str | Path, settings: Settings | None = None, namespace: str | None = None) -> Swim:
    """Return the swim of one robot in a bag.

    Parameters
    ----------
    path
        The directory of the bag, or its MCAP file.
    settings
        The parameters with which it was made; by default those that `simulate` wrote into the bag, or the defaults.
    namespace
        The namespace of the robot; by default that of the only one.

    Raises
    ------
    ValueError
        It is no bag or is damaged, has fewer than two `odom` messages or one without a pose, or was made with other
        numbers of chains and links than `settings` have. Begins with the path.

    """
    with BagReader(path, namespace) as bag:
        settings = settings or bag.settings or Settings()
        names = ('odom', 'fin_wrench', 'joint_states', 'fin_markers', 'fin_command')
        series: dict[str, dict[float, Any]] = {name: {} for name in names}  # a state that is repeated counts once
        now = None
        for logged in bag.messages(names):
            if logged.name == 'fin_command':
                if now is not None and (gait := _gait(bag, logged)) is not None:
                    series['fin_command'][now] = gait
                continue
            message = bag.decode(logged)
            stamp = _stamp(message)
            series[logged.name][stamp] = message
            if logged.name == 'odom':
                now = stamp
        clocked = '/clock' in bag.names
    if len(series['odom']) < 2:
        raise ValueError(f'{path}: has {len(series["odom"])} messages on odom, but must have at least 2')
    origin = 0.0 if clocked else min(series['odom'])
    try:
        joints = _joints(series['joint_states'], origin, settings) if series['joint_states'] else None
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from error
    time, odometry = _sorted(series['odom'], origin)
    wrench_time, wrenches = _sorted(series['fin_wrench'], origin)
    gait_time, gaits = _sorted(series['fin_command'], origin)
    position = np.array([_vector(each.pose.pose.position) for each in odometry])
    orientation = np.array([[*_vector(each.pose.pose.orientation), each.pose.pose.orientation.w] for each in odometry])
    if not (np.isfinite(position).all() and (np.abs(np.linalg.norm(orientation, axis=1) - 1.0) < UNIT_TOLERANCE).all()):
        raise ValueError(f'{path}: has an odom whose position is not finite, or whose orientation has no norm of 1 '
                         f'within {UNIT_TOLERANCE:g}')
    return Swim(
        settings, time, position, orientation,
        np.array([[*_vector(each.twist.twist.linear), *_vector(each.twist.twist.angular)] for each in odometry]),
        wrench_time,
        np.array([[*_vector(each.wrench.force), *_vector(each.wrench.torque)] for each in wrenches]).reshape(-1, 6),
        joints, _markers(series['fin_markers'], origin), gait_time, np.array(gaits).reshape(-1, 6))


def _gait(bag: BagReader, logged: Any) -> FloatArray | None:
    """Return the first six values of a `fin_command`; None if there are not six or ten, which the node refuses."""
    try:
        values = np.asarray(bag.decode(logged).data)
    except ValueError:  # rosbags does not read an empty one of rclpy
        return None
    return values[:6] if len(values) in (6, 10) else None


def _joints(messages: dict[float, Any], origin: float, settings: Settings) -> Joints | None:
    """Return what the joint states say; None if they do not have all rods with rates and torques."""
    _, (first, *_) = _sorted(messages, origin)
    names = {name: index for index, name in enumerate(first.name)}
    time, states = _sorted(  # publish_fin_joints may change in a recording
        {stamp: state for stamp, state in messages.items() if state.name == first.name}, origin)
    complete = all(len(names) == len(part) for part in (first.position, first.velocity, first.effort))
    if not complete or not all(rod in names for rod in RODS):
        return None
    rods = [names[rod] for rod in RODS]
    angles, rates, torques = (
        np.array([getattr(state, part) for state in states]) for part in ('position', 'velocity', 'effort'))
    chains = {tuple(map(int, found.groups()[1:])) for name in names if (found := CHAIN_JOINT.fullmatch(name))}
    fin, joint_angles = settings.model.fin, None
    if chains:
        chain, link = (1 + max(numbers) for numbers in zip(*chains, strict=True))
        if (chain, link) != (fin.chains, fin.links):
            raise ValueError(
                f'has fins of {chain} chains and {link} links, but the parameters have {fin.chains} and {fin.links}: '
                'give those with which it was made (--config)')
        order = [
            names[f'{side}_chain_{c}_joint_{j}'] for side in SIDES for c in range(chain) for j in range(link)]
        joint_angles = angles[:, order].reshape(-1, 2, chain, link)
    rod_angles, rod_rates, rod_torques = (part[:, rods].reshape(-1, 2, 2) for part in (angles, rates, torques))
    return Joints(time, rod_angles, rod_rates, rod_torques, joint_angles)


def _markers(messages: dict[float, Any], origin: float) -> FinMarkers | None:
    time, arrays = _sorted(messages, origin)
    if not arrays:
        return None
    corners = []
    for array in arrays:
        corners.append([
            [_vector(point) for marker in array.markers if marker.ns == name for point in marker.points]
            for name in FINS])
    return FinMarkers(time, np.array(corners))


def _sorted(messages: dict[float, Any], origin: float) -> tuple[FloatArray, list[Any]]:
    """Return times less `origin` and messages, in the order of the times."""
    return np.array(sorted(messages)) - origin, [messages[time] for time in sorted(messages)]


def _stamp(message: Any) -> float:
    stamp = (message.markers[0] if hasattr(message, 'markers') else message).header.stamp
    return float(stamp.sec + stamp.nanosec * 1e-9)


def _vector(part: Any) -> list[float]:
    return [part.x, part.y, part.z]
