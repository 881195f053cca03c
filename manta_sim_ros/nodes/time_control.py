"""Pause, step, reset, and a new pose: what controls simulated time and the robot, and its services and topic."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeVar

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from manta_sim_ros.dynamics import FloatArray, State
from manta_sim_ros.nodes import messages
from manta_sim_ros.nodes.leader_clock import FOLLOWS, LeaderClock
from manta_sim_ros.nodes.qos import Input
from manta_sim_ros.nodes.refusals import Refusals
from manta_sim_ros.nodes.robot import Robot
from manta_sim_ros.nodes.settings import Settings

Response = TypeVar('Response', SetBool.Response, Trigger.Response)

LONGEST_STEP = 50.0
"""Longest elapsed time of one request to step [s], after which the node hears everybody else again."""


def _within(duration: float, states: Iterable[State]) -> Iterator[State]:
    """Yield states, at least one, until the elapsed time `duration` [s] is over."""
    end = time.monotonic() + duration
    for state in states:
        yield state
        if time.monotonic() >= end:
            return


class TimeControl:
    """Simulated time and where the robot is: `~/pause`, `~/step`, `~/reset`, `set_pose`, `initialpose`.

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
        self._poses = (
            Input(node, 'set_pose', self._set_pose), Input(node, 'initialpose', self._set_planar_pose))
        warn = node.get_logger().warning
        self.refusals = {
            **{topic: Refusals(warn, topic, 'the robot stays where it is') for topic in ('set_pose', 'initialpose')},
            'service calls': Refusals(warn, 'service calls', 'nothing changes')}
        """The refused messages of `set_pose` and `initialpose`, and the refused calls of services."""

    @property
    def paused(self) -> bool:
        """Whether simulated time stands still except for steps; never of a node that follows a clock."""
        return self._paused and not self._leader.followed

    def pause(self, paused: bool) -> str:
        """Let simulated time stand still or run, and return what it does now and when that is, in words.

        Raises
        ------
        ValueError
            The node follows a clock.

        """
        if self._leader.followed:
            raise ValueError(FOLLOWS)
        before, self._paused = self._paused, paused
        if before and not paused:
            self._resume()
        return f'{"paused" if paused else "running"} at {self._now}'

    def step(self, count: int = 1) -> tuple[bool, str]:
        """Advance by exactly `count` times `step_duration`, with all outputs in it.

        Return whether that was done, and in words to where. It was not if the motion diverged, or if it took longer
        than `LONGEST_STEP`.

        Raises
        ------
        ValueError
            The node follows a clock, is not paused, or `step_duration` is not a whole number of time steps.

        """
        if self._leader.followed:
            raise ValueError(FOLLOWS)
        if not self.paused:
            raise ValueError('not paused: simulated time is running; first call the service ~/pause with data true')
        duration = self._settings().node.step_duration
        states = self._robot.ticks(duration, count)
        before, end = self._robot.divergences, self._robot.state.time + count * duration
        self._publish(_within(LONGEST_STEP, states))
        diverged = self._robot.divergences != before
        cut_short = self._robot.state.time < end - 0.5 * self._settings().model.solver.time_step
        words = f'stepped to {self._now}'
        if cut_short:
            words += f' only, as a step takes at most {LONGEST_STEP:g} s: step again, or set a shorter step_duration'
        if diverged:
            words += ', but the motion diverged and the robot was put at rest where it was'
        return not (diverged or cut_short), words

    def reset(self) -> str:
        """Put the robot at rest where it started, drop what was sent before, and return the time in words."""
        for topic in self._poses:
            topic.drain()
        self._forget_inputs()
        self._show(self._robot.reset())
        return f'at rest where it started, at {self._now}'

    def put(
        self, position: Sequence[float], orientation: Sequence[float], twist: FloatArray | None = None,
    ) -> None:
        """Put the robot at a pose as `Robot.put` does, and publish that where time stands still."""
        self._show(self._robot.put(position, orientation, twist))

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        return self._answer(response, lambda: (True, self.pause(request.data)))

    def _step(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._answer(response, self.step)

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._answer(response, lambda: (True, self.reset()))

    def _answer(self, response: Response, act: Callable[[], tuple[bool, str]]) -> Response:
        try:
            response.success, response.message = act()
        except ValueError as error:
            response.success, response.message = False, str(error)
            self.refusals['service calls'].count(str(error))
        return response

    def _set_pose(self, message: PoseStamped) -> None:
        try:
            self.put(*messages.pose_of(message, self._settings().node.odom_frame))
        except ValueError as error:
            self.refusals['set_pose'].add(error)

    def _set_planar_pose(self, message: PoseWithCovarianceStamped) -> None:
        height = float(self._robot.state.position[2])
        try:
            self.put(*messages.planar_pose_of(message, self._settings().node.odom_frame, height))
        except ValueError as error:
            self.refusals['initialpose'].add(error)

    def _show(self, state: State) -> None:
        if self.paused or self._leader.stands_still:  # else no output would show it before the next step
            self._publish([state])

    @property
    def _now(self) -> str:
        return f'{self._robot.state.time:.9g} s of simulated time'
