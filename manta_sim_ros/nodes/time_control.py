"""Pause, step, reset, and a new pose: the services and the topic that control simulated time and the robot."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from manta_sim_ros.dynamics import State
from manta_sim_ros.nodes import messages
from manta_sim_ros.nodes.qos import drain, subscription
from manta_sim_ros.nodes.refusals import Refusals
from manta_sim_ros.nodes.robot import Robot
from manta_sim_ros.nodes.settings import Settings


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
    publish
        Publishes the outputs of consecutive states.
    resume
        Is called when time begins to run again.
    forget_inputs
        Drops the commands that were received but not taken yet, and ends disturbances.

    """

    def __init__(
        self, node: Node, robot: Robot, settings: Callable[[], Settings], publish: Callable[[Iterable[State]], None],
        resume: Callable[[], None], forget_inputs: Callable[[], None],
    ) -> None:
        self._robot, self._settings = robot, settings
        self._publish, self._resume, self._forget_inputs = publish, resume, forget_inputs
        self.paused = settings().node.start_paused
        """Whether simulated time stands still except for steps."""
        node.create_service(SetBool, '~/pause', self._pause)
        node.create_service(Trigger, '~/step', self._step)
        node.create_service(Trigger, '~/reset', self._reset)
        self._poses = subscription(node, 'set_pose', self._set_pose)
        self.refusals = Refusals(node.get_logger().warning, 'set_pose', 'the robot stays where it is')
        """The refused messages of `set_pose`."""

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        before, self.paused = self.paused, request.data
        if before and not self.paused:
            self._resume()
        response.success, response.message = True, f'{"paused" if self.paused else "running"} at {self._now}'
        return response

    def _step(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self.paused:
            response.message = 'not paused: simulated time is running; first call the service ~/pause with data true'
            return response
        try:
            states = self._robot.ticks(self._settings().node.step_duration)
        except ValueError as error:
            response.message = str(error)
            return response
        before = self._robot.divergences
        self._publish(states)
        response.success = self._robot.divergences == before
        response.message = f'stepped to {self._now}'
        if not response.success:
            response.message += ', but the motion diverged and the robot was put at rest where it was'
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
            self.refusals.add(error)

    def _put(self, state: State) -> None:
        if self.paused:  # else no output would show it before the next step
            self._publish([state])

    @property
    def _now(self) -> str:
        return f'{self._robot.state.time:.9g} s of simulated time'
