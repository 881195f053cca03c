"""The outputs of the node: all messages of a state have one stamp, and the clock is published last."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher

from manta_sim_ros.dynamics import SIDES, State
from manta_sim_ros.nodes import messages
from manta_sim_ros.nodes.markers import Markers
from manta_sim_ros.nodes.qos import QUEUE_DEPTH, publisher
from manta_sim_ros.nodes.settings import Settings

PATH_LENGTH = 20.0
"""Length of the path in the markers [m]: some minutes of swimming."""

PATIENCE = 5.0
"""Longest wait for subscribers that do not take their messages [s]."""

CLOCK_PERIOD = 1.0
"""Elapsed time after which the clock is published again while simulated time stands still [s]."""

ROUNDING = 1e-6  # tolerance of a number of periods: far above the rounding of a time and far below a time step


class Outputs:
    """The publishers of the simulated robot.

    Parameters
    ----------
    node
        The node that publishes.
    settings
        Returns the present parameters of the node.
    mean_current
        Returns the mean velocity (3,) of the water, world frame [m/s].
    follows
        Returns whether the node follows the clock of another one, so that its stamps are simulated time.

    """

    def __init__(
        self, node: Node, settings: Callable[[], Settings], mean_current: Callable[[], Sequence[float]],
        follows: Callable[[], bool],
    ) -> None:
        self._node, self._settings, self._mean_current, self._follows = node, settings, mean_current, follows
        self._pose = publisher(node, 'pose')
        self._twist = publisher(node, 'twist')
        self._odometry = publisher(node, 'odom')
        self._wrench = publisher(node, 'fin_wrench')
        self._fin_wrenches = [publisher(node, f'{side}_fin/wrench') for side in SIDES]
        self._imu = publisher(node, 'imu/data')
        self._pressure = publisher(node, 'pressure')
        self._joint_states = publisher(node, 'joint_states')
        self._fin_markers = publisher(node, 'fin_markers')
        self._markers = Markers(PATH_LENGTH)
        self._transforms = _transform_publisher(node) if settings().node.publish_tf else None
        self._clock = publisher(node, '/clock') if settings().node.publish_clock else None
        self._clock_template = messages.clock_template()
        self._publishers = [
            self._pose, self._twist, self._odometry, self._wrench, *self._fin_wrenches, self._imu, self._pressure,
            self._joint_states, self._fin_markers, *filter(None, (self._transforms, self._clock))]
        self._queued: Counter[Publisher[Any]] = Counter()  # messages without a receipt
        self._transformed_at: Time | None = None  # tf2 takes one transform per stamp, and a slow /clock repeats stamps
        self._before: State | None = None
        self._clock_due = math.inf  # steady time at which the clock is repeated [s]
        self._latest: dict[Publisher[Any], Any] = {}  # the last message
        self._subscribers: Counter[Publisher[Any]] = Counter()  # when they were counted
        self._stamp = Time()  # of the last state
        self._templates_for: Settings | None = None
        self._update_templates()

    @property
    def lacks_transform(self) -> bool:
        """Whether the transform cannot be published because tf2_msgs is not installed."""
        return self._transforms is None and self._settings().node.publish_tf

    @property
    def another_clock(self) -> bool:
        """Whether another node publishes /clock beside this one."""
        return self._clock is not None and self._node.count_publishers(self._clock.topic_name) > 1

    def stamp(self, state: State) -> Time:
        """Return the stamp of a state: its time, or the time of the node if that has no part in /clock."""
        if self._clock is not None or self._follows():
            return messages.time_message(state.time)
        return self._node.get_clock().now().to_msg()

    def publish_all(self, states: Iterable[State]) -> None:
        """Publish the outputs of consecutive states at once, without losing a message.

        Whenever the queue of a publisher may be full, with `QUEUE_DEPTH` messages, this waits until all reliable
        subscribers have received them. If that takes longer than `PATIENCE` once, it does not wait any more. It does
        not wait for a queue that is not full: Fast DDS asks for receipts when it is full, but otherwise only every 3 s.
        """
        for each in list(self._queued):
            if each.wait_for_all_acked(Duration()):
                del self._queued[each]
        waiting = self._wait_for_room()
        for state in states:
            self.publish(state)
            waiting = waiting and self._wait_for_room()

    def _wait_for_room(self) -> bool:
        """Wait for the receipts of publishers with a full queue; return False if that takes too long."""
        deadline = time.monotonic() + PATIENCE
        for full in [each for each, count in self._queued.items() if count >= QUEUE_DEPTH]:
            if not full.wait_for_all_acked(Duration(seconds=max(0.0, deadline - time.monotonic()))):
                return False
            del self._queued[full]
        return True

    def _send(self, to: Publisher[Any], message: Any) -> None:
        to.publish(message)
        self._latest[to] = message
        self._queued[to] += 1

    def lacks(self, state: State) -> bool:
        """Whether the time of a state is another one than that of the last outputs."""
        return self._before is None or self._before.time != state.time

    def repeat_clock(self) -> None:
        """Publish the clock again if the last time was `CLOCK_PERIOD` ago."""
        if self._clock is not None and time.monotonic() >= self._clock_due:
            self._send_clock(self._latest[self._clock])

    def _send_clock(self, message: Any) -> None:
        if self._clock is not None:
            self._send(self._clock, message)
            self._clock_due = time.monotonic() + CLOCK_PERIOD

    def _count_subscribers(self) -> None:
        """Count the subscribers that will get the next state: all but those that come later."""
        for each in self._publishers:
            self._subscribers[each] = each.get_subscription_count()

    def publish_to_latecomers(self) -> None:
        """Publish the last state again on the topics that have more subscribers than were counted."""
        if self._before is None:
            return
        self._update_templates()
        for each in self._publishers:
            before, self._subscribers[each] = self._subscribers[each], each.get_subscription_count()
            if self._subscribers[each] <= before:
                continue
            if each is self._joint_states:  # its last message may be of an earlier state, as its rate is another one
                self._send(each, self._joints.write(self._stamp, self._before))
            elif each is self._fin_markers:
                self._show(self._before, self._stamp)
            elif each in self._latest:
                self._send(each, self._latest[each])

    def publish(self, state: State) -> None:
        """Publish all outputs of a state that are due, then the clock."""
        self._count_subscribers()
        stamp, own = self.stamp(state), self._settings().node
        self._update_templates()
        for to, template in self._every_time:
            self._send(to, template.write(stamp, state))
        if self._transforms is not None and stamp != self._transformed_at:
            self._send(self._transforms, self._transform.write(stamp, state))
            self._transformed_at = stamp
        if self._was_put(state):
            self._markers.forget()
        if self._due(state, own.joint_state_rate):
            self._send(self._joint_states, self._joints.write(stamp, state))
        if self._due(state, own.marker_rate):
            self._show(state, stamp)
        self._send_clock(self._clock_template.write(stamp, state))
        self._before, self._stamp = state, stamp

    def _update_templates(self) -> None:
        """Make the templates of the messages again if a parameter has changed: names and variances depend on them."""
        settings = self._settings()
        if settings is self._templates_for:
            return
        model, odom, base = settings.model, settings.node.odom_frame, settings.node.base_frame
        self._templates_for = settings
        self._every_time = [
            (self._pose, messages.pose_template(odom)),
            (self._twist, messages.twist_template(base)),
            (self._odometry, messages.odometry_template(odom, base)),
            (self._wrench, messages.wrench_template(base, lambda state: state.wrench)),
            (self._fin_wrenches[0], messages.wrench_template(base, lambda state: state.fin_wrenches[0])),
            (self._fin_wrenches[1], messages.wrench_template(base, lambda state: state.fin_wrenches[1])),
            (self._imu, messages.imu_template(settings.imu, model, base)),
            (self._pressure, messages.pressure_template(settings.pressure, model, base)),
        ]
        if self._transforms is not None:
            self._transform = messages.transform_template(self._transforms.msg_type, odom, base)
        self._joints = messages.joint_state_template(model, settings.node.publish_fin_joints, base)

    def _was_put(self, state: State) -> bool:
        """Whether the robot was put at a pose since the last state: its steps are counted again, or no time passed."""
        before = self._before
        return before is not None and (before.start_time != state.start_time or before.time == state.time)

    def _due(self, state: State, rate: float) -> bool:
        """Whether an output with another rate is due: a multiple of its period has passed since the last state."""
        before = 0.0 if self._before is None else self._before.time
        if before >= state.time:  # a new pose, the first state, or a clock that is followed went back
            return True
        return math.floor(state.time * rate + ROUNDING) > math.floor(before * rate + ROUNDING)

    def _show(self, state: State, stamp: Time) -> None:
        """Publish the markers if there is a subscriber."""
        if self._fin_markers.get_subscription_count():
            own = self._settings().node
            base, odom = messages.header(stamp, own.base_frame), messages.header(stamp, own.odom_frame)
            self._send(self._fin_markers, self._markers.message(
                state, self._settings().model, base, odom, self._mean_current()))
        else:
            self._markers.forget()


def _transform_publisher(node: Node) -> Publisher[Any] | None:
    """Return the publisher of /tf, or None without tf2_msgs."""
    try:
        return publisher(node, '/tf')
    except ModuleNotFoundError:
        return None
