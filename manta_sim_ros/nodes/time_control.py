"""Pause, step, reset, and a new pose: the services and the topic that control simulated time and the robot."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from manta_sim_ros.dynamics import State
from manta_sim_ros.nodes import messages
from manta_sim_ros.nodes.leader_clock import FOLLOWS, LeaderClock
from manta_sim_ros.nodes.qos import drain, subscription
from manta_sim_ros.nodes.refusals import Refusals
from manta_sim_ros.nodes.robot import Robot
from manta_sim_ros.nodes.settings import Settings

Response = TypeVar('Response', SetBool.Response, Trigger.Response)

LONGEST_STEP = 50.0
"""Longest elapsed time of one `~/step` [s], after which the node hears everybody else again."""


def _within(duration: float, states: Iterable[State]) -> Iterator[State]:
    """Yield states, at least one, until the elapsed time `duration` [s] is over."""
    end = time.monotonic() + duration
    for state in states:
        yield state
        if time.monotonic() >= end:
            return


class TimeControl:
    """The services `~/pause`, `~/step` and `~/reset`, and the topic `set_pose`.

    Parameters
    ----------
    node
        The node that offers the services.
    robot
        The robot on which they act.
    settings
        Returns the present parameters of the node.
    leader
        The clock that the node may follow: then pause and step are refused.
    publish
        Publishes the outputs of consecutive states.
    resume
        Is called when time begins to run again.
    forget_inputs
        Drops the commands that were received but not taken yet, and ends disturbances.

    """

    def __init__(
        self, node: Node, robot: Robot, settings: Callable[[], Settings], leader: LeaderClock,
        publish: Callable[[Iterable[State]], None], resume: Callable[[], None], forget_inputs: Callable[[], None],
    ) -> None:
        self._robot, self._settings, self._leader = robot, settings, leader
        self._publish, self._resume, self._forget_inputs = publish, resume, forget_inputs
        self._paused = settings().node.start_paused
        node.create_service(SetBool, '~/pause', self._pause)
        node.create_service(Trigger, '~/step', self._step)
        node.create_service(Trigger, '~/reset', self._reset)
        self._poses = subscription(node, 'set_pose', self._set_pose)
        warn = node.get_logger().warning
        self.refusals = {
            'set_pose': Refusals(warn, 'set_pose', 'the robot stays where it is'),
            'service calls': Refusals(warn, 'service calls', 'nothing changes')}
        """The refused messages of `set_pose`, and the refused calls of services."""

    @property
    def paused(self) -> bool:
        """Whether simulated time stands still except for steps; never of a node that follows a clock."""
        return self._paused and not self._leader.followed

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if self._leader.followed:
            return self._refuse(response, FOLLOWS)
        before, self._paused = self._paused, request.data
        if before and not self._paused:
            self._resume()
        response.success, response.message = True, f'{"paused" if self._paused else "running"} at {self._now}'
        return response

    def _step(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._leader.followed:
            return self._refuse(response, FOLLOWS)
        if not self.paused:
            return self._refuse(
                response, 'not paused: simulated time is running; first call the service ~/pause with data true')
        try:
            states = self._robot.ticks(self._settings().node.step_duration)
        except ValueError as error:
            return self._refuse(response, str(error))
        before, end = self._robot.divergences, self._robot.state.time + self._settings().node.step_duration
        self._publish(_within(LONGEST_STEP, states))
        diverged = self._robot.divergences != before
        cut_short = self._robot.state.time < end - 0.5 * self._settings().model.solver.time_step
        response.success = not (diverged or cut_short)
        response.message = f'stepped to {self._now}'
        if cut_short:
            response.message += (
                f' only, as a step takes at most {LONGEST_STEP:g} s: step again, or set a shorter step_duration')
        if diverged:
            response.message += ', but the motion diverged and the robot was put at rest where it was'
        return response

    def _refuse(self, response: Response, reason: str) -> Response:
        response.success, response.message = False, reason
        self.refusals['service calls'].count(reason)
        return response

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        drain(self._poses)
        self._forget_inputs()
        self._put(self._robot.reset())
        response.success, response.message = True, f'at rest where it started, at {self._now}'
        return response

    def _set_pose(self, message: PoseStamped) -> None:
        try:
            self._put(self._robot.put(*messages.pose_of(message, self._settings().node.odom_frame)))
        except ValueError as error:
            self.refusals['set_pose'].add(error)

    def _put(self, state: State) -> None:
        if self.paused or self._leader.stands_still:  # else no output would show it before the next step
            self._publish([state])

    @property
    def _now(self) -> str:
        return f'{self._robot.state.time:.9g} s of simulated time'
