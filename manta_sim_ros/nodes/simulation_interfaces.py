"""The standard services of simulators, those of simulation_interfaces: what the node does anyway, in their words."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Accel, Point, Pose, Quaternion, Twist, Vector3
from rclpy.node import Node
from simulation_interfaces import srv
from simulation_interfaces.msg import (
    Bounds,
    EntityCategory,
    EntityInfo,
    EntityState,
    Result,
    SimulationState,
    SimulatorFeatures,
)

from manta_sim_ros.dynamics import FloatArray, State, shown
from manta_sim_ros.nodes import messages
from manta_sim_ros.nodes.entity_filters import matches, within_sphere
from manta_sim_ros.nodes.interface import SERVICES
from manta_sim_ros.nodes.leader_clock import FOLLOWS, LeaderClock
from manta_sim_ros.nodes.robot import Robot
from manta_sim_ros.nodes.settings import Settings
from manta_sim_ros.nodes.time_control import TimeControl

FEATURES = {
    '~/get_simulation_state': ('SIMULATION_STATE_GETTING',),
    '~/set_simulation_state': ('SIMULATION_STATE_SETTING', 'SIMULATION_STATE_PAUSE'),
    '~/step_simulation': ('STEP_SIMULATION_SINGLE', 'STEP_SIMULATION_MULTIPLE'),
    '~/reset_simulation': ('SIMULATION_RESET', 'SIMULATION_RESET_STATE'),
    '~/get_entities': ('ENTITY_CATEGORIES',),
    '~/get_entity_info': ('ENTITY_INFO_GETTING',),
    '~/get_entity_state': ('ENTITY_STATE_GETTING',),
    '~/set_entity_state': ('ENTITY_STATE_SETTING',),
}
"""The features of the standard that each service brings."""

OF_THE_LEADER = ('~/set_simulation_state', '~/step_simulation')
"""What a node that follows a clock refuses."""

ABOUT = 'one step takes the parameter step_duration; a reset lets time go on, as it never runs backward'

Answer = tuple[int, str]
"""Result code and message."""


class _RefusedError(Exception):
    """A request is refused: result code and reason."""


@contextlib.contextmanager
def _errors_as(code: int) -> Iterator[None]:
    """Refuse the request with this result code if a value is invalid."""
    try:
        yield
    except ValueError as error:
        raise _RefusedError(code, str(error)) from error


class SimulationInterfaces:
    """The services of simulation_interfaces, with the robot as the only entity; see `SERVICES`.

    Parameters
    ----------
    node
        The node that offers them. Its full name is the name of the entity.
    robot
        Its robot.
    settings
        Returns the present parameters of the node.
    leader
        The clock that the node may follow: then the state and steps are refused.
    time_control
        What does the same for the other services.
    stamp
        Returns the stamp of a state.

    """

    def __init__(
        self, node: Node, robot: Robot, settings: Callable[[], Settings], leader: LeaderClock,
        time_control: TimeControl, stamp: Callable[[State], Time],
    ) -> None:
        self._robot, self._settings, self._leader = robot, settings, leader
        self._time, self._stamp = time_control, stamp
        self._entity = node.get_fully_qualified_name()
        offered: dict[str, Callable[[Any, Any], Any]] = {'~/get_simulator_features': self._get_features}
        for name, answer in {
            '~/get_simulation_state': self._get_state, '~/set_simulation_state': self._set_state,
            '~/step_simulation': self._step, '~/reset_simulation': self._reset,
            '~/get_entities': self._get_entities, '~/get_entity_info': self._get_entity_info,
            '~/get_entity_state': self._get_entity_state, '~/set_entity_state': self._set_entity_state,
        }.items():
            offered[name] = self._with_result(answer)
        self._offered = []
        for name, callback in offered.items():
            kind = getattr(srv, SERVICES[name].type.rpartition('/')[2], None)
            if kind is not None:  # in the installed version
                node.create_service(kind, name, callback)
                self._offered.append(name)

    def _with_result(self, answer: Callable[[Any, Any], Answer]) -> Callable[[Any, Any], Any]:
        """Return the callback that answers with a result, and counts the request if that is a refusal."""
        def callback(request: Any, response: Any) -> Any:
            try:
                response.result.result, response.result.error_message = answer(request, response)
            except _RefusedError as error:
                response.result.result, response.result.error_message = error.args
                self._time.refusals['service calls'].count(response.result.error_message)
            return response
        return callback

    def _get_features(self, request: Any, response: Any) -> Any:
        left_out = OF_THE_LEADER if self._leader.followed else ()
        response.features.features = [
            getattr(SimulatorFeatures, feature) for name in self._offered if name not in left_out
            for feature in FEATURES.get(name, ())]
        response.features.custom_info = f'{ABOUT}; {FOLLOWS}' if left_out else ABOUT
        return response

    def _get_state(self, request: Any, response: Any) -> Answer:
        still = self._time.paused or self._leader.stands_still
        response.state.state = SimulationState.STATE_PAUSED if still else SimulationState.STATE_PLAYING
        return Result.RESULT_OK, ''

    def _set_state(self, request: Any, response: Any) -> Answer:
        states = {SimulationState.STATE_PLAYING: False, SimulationState.STATE_PAUSED: True}
        wanted = states.get(request.state.state)
        if wanted is None:
            raise _RefusedError(
                Result.RESULT_FEATURE_UNSUPPORTED,
                f'state is {request.state.state}, but must be {SimulationState.STATE_PLAYING} (playing) or '
                f'{SimulationState.STATE_PAUSED} (paused): time never goes back to its start, and no request ends the '
                'node')
        self._refuse_follower()
        already = self._time.paused == wanted
        words = self._time.pause(wanted)
        return (srv.SetSimulationState.Response.ALREADY_IN_TARGET_STATE if already else Result.RESULT_OK), words

    def _step(self, request: Any, response: Any) -> Answer:
        self._refuse_follower()
        if request.steps == 0:
            raise _RefusedError(Result.RESULT_OPERATION_FAILED, 'steps is 0, but must be at least 1')
        with _errors_as(Result.RESULT_OPERATION_FAILED):
            done, words = self._time.step(request.steps)
        return (Result.RESULT_OK if done else Result.RESULT_OPERATION_FAILED), words

    def _reset(self, request: Any, response: Any) -> Answer:
        if request.scope != srv.ResetSimulation.Request.SCOPE_STATE:
            raise _RefusedError(
                Result.RESULT_FEATURE_UNSUPPORTED,
                f'scope is {request.scope}, but must be {srv.ResetSimulation.Request.SCOPE_STATE} (state): time never '
                'runs backward, and nothing is spawned')
        return Result.RESULT_OK, self._time.reset()

    def _get_entities(self, request: Any, response: Any) -> Answer:
        filters = request.filters
        if filters.tags.tags:
            raise _RefusedError(
                Result.RESULT_FEATURE_UNSUPPORTED, 'filters.tags.tags is not empty, but entities have no tags here')
        if filters.bounds.type not in (Bounds.TYPE_EMPTY, Bounds.TYPE_SPHERE):
            raise _RefusedError(
                Result.RESULT_FEATURE_UNSUPPORTED,
                f'filters.bounds.type is {filters.bounds.type}, but must be {Bounds.TYPE_EMPTY} (none) or '
                f'{Bounds.TYPE_SPHERE} (sphere)')
        with _errors_as(Result.RESULT_FEATURE_UNSUPPORTED):
            found = matches(filters.filter, self._entity)
        if filters.bounds.type == Bounds.TYPE_SPHERE:
            with _errors_as(Result.RESULT_OPERATION_FAILED):
                points = [(point.x, point.y, point.z) for point in filters.bounds.points]
                found &= within_sphere(points, self._robot.state.position)
        categories = {category.category for category in filters.categories}
        if found and (not categories or EntityCategory.CATEGORY_ROBOT in categories):
            response.entities = [self._entity]
        return Result.RESULT_OK, ''

    def _get_entity_info(self, request: Any, response: Any) -> Answer:
        self._check_entity(request.entity)
        response.info = EntityInfo(
            category=EntityCategory(category=EntityCategory.CATEGORY_ROBOT), description='robotic manta ray')
        return Result.RESULT_OK, ''

    def _get_entity_state(self, request: Any, response: Any) -> Answer:
        self._check_entity(request.entity)
        state = self._robot.state
        (x, y, z), (qx, qy, qz, qw) = state.position.tolist(), state.orientation.tolist()
        twist, acceleration = messages.world_motion(state)
        response.state = EntityState(
            header=messages.header(self._stamp(state), self._settings().node.odom_frame),
            pose=Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw)),
            twist=Twist(linear=_vector(twist[:3]), angular=_vector(twist[3:])),
            acceleration=Accel(linear=_vector(acceleration[:3]), angular=_vector(acceleration[3:])))
        return Result.RESULT_OK, ''

    def _set_entity_state(self, request: Any, response: Any) -> Answer:
        self._check_entity(request.entity)
        sets_pose, sets_twist = (getattr(request, flag, True) for flag in ('set_pose', 'set_twist'))  # not before 2.1
        if not (sets_pose or sets_twist):
            return Result.RESULT_OK, 'nothing changes, as neither set_pose nor set_twist is true'
        frame, wanted = self._settings().node.odom_frame, request.state
        wanted.header.frame_id = wanted.header.frame_id or frame
        position, orientation = self._robot.state.position.tolist(), self._robot.state.orientation.tolist()
        twist, failed = None, Result.RESULT_OPERATION_FAILED
        if sets_pose:
            with _errors_as(getattr(srv.SetEntityState.Response, 'INVALID_POSE', failed)):  # not in 1.0
                position, orientation = messages.pose_of(wanted, frame)
        with _errors_as(failed):
            if sets_twist:
                twist = messages.twist_of(wanted, frame, orientation)
            self._time.put(position, orientation, twist)
        return Result.RESULT_OK, ''

    def _refuse_follower(self) -> None:
        if self._leader.followed:
            raise _RefusedError(Result.RESULT_FEATURE_UNSUPPORTED, FOLLOWS)

    def _check_entity(self, name: str) -> None:
        if name != self._entity:
            raise _RefusedError(
                Result.RESULT_NOT_FOUND, f'entity is {shown(name)}, but must be {shown(self._entity)}, the only one')


def _vector(values: FloatArray) -> Vector3:
    x, y, z = values.tolist()
    return Vector3(x=x, y=y, z=z)
