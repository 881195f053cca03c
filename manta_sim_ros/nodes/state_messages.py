"""The messages of consecutive states: which of them are due, and in which order."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from builtin_interfaces.msg import Time

from manta_sim_ros.dynamics import State
from manta_sim_ros.nodes import messages
from manta_sim_ros.nodes.markers import Markers
from manta_sim_ros.nodes.settings import Settings

PATH_LENGTH = 20.0
"""Length of the path in the markers [m]: some minutes of swimming."""

ROUNDING = 1e-6  # tolerance of a number of periods: far above the rounding of a time and far below a time step


class StateMessages:
    """The messages that say a state on the topics of the simulator, serialized where that is possible.

    Parameters
    ----------
    settings
        Returns the present parameters.
    mean_current
        Returns the mean velocity (3,) of the water, world frame [m/s].
    shows_markers
        Returns whether somebody looks at the markers, which take long to make.
    transform_class
        The class of a tf2_msgs/msg/TFMessage; None leaves /tf out.

    """

    def __init__(
        self, settings: Callable[[], Settings], mean_current: Callable[[], Sequence[float]],
        shows_markers: Callable[[], bool], transform_class: type[Any] | None,
    ) -> None:
        self._settings, self._mean_current, self._shows_markers = settings, mean_current, shows_markers
        self._transform_class = transform_class
        self._markers = Markers(PATH_LENGTH)
        self._clock = messages.clock_template()
        self._transformed_at: Time | None = None  # tf2 takes one transform per stamp, and a slow /clock repeats stamps
        self._before: State | None = None
        self._stamp = Time()  # of the last state
        self._templates_for: Settings | None = None
        self._update_templates()

    @property
    def state(self) -> State | None:
        """The last state."""
        return self._before

    def of(self, state: State, stamp: Time) -> list[tuple[str, Any]]:
        """Return topics and messages of the next state that are due, /clock last; a publisher takes each message."""
        self._update_templates()
        own = self._settings().node
        due = [(topic, template.write(stamp, state)) for topic, template in self._every_time.items()]
        if self._transform is not None and stamp != self._transformed_at:
            due.append(('/tf', self._transform.write(stamp, state)))
            self._transformed_at = stamp
        if self._was_put(state):
            self._markers.forget()
        if self._due(state, own.joint_state_rate):
            due.append(('joint_states', self._joints.write(stamp, state)))
        if self._due(state, own.marker_rate):
            if self._shows_markers():
                due.append(('fin_markers', self._marker_message(state, stamp)))
            else:
                self._markers.forget()
        self._before, self._stamp = state, stamp
        return [*due, ('/clock', self._clock.write(stamp, state))]

    def again(self, topic: str) -> Any | None:
        """Return the message of the last state on a topic that has a rate of its own; None for the other topics."""
        if self._before is None:
            return None
        self._update_templates()
        if topic == 'joint_states':
            return self._joints.write(self._stamp, self._before)
        return self._marker_message(self._before, self._stamp) if topic == 'fin_markers' else None

    def _marker_message(self, state: State, stamp: Time) -> Any:
        settings = self._settings()
        return self._markers.write(
            state, settings.model, stamp, settings.node.base_frame, settings.node.odom_frame, self._mean_current())

    def _update_templates(self) -> None:
        """Make the templates of the messages again if a parameter has changed: names and variances depend on them."""
        settings = self._settings()
        if settings is self._templates_for:
            return
        model, odom, base = settings.model, settings.node.odom_frame, settings.node.base_frame
        self._templates_for = settings
        self._every_time = {
            'pose': messages.pose_template(odom),
            'twist': messages.twist_template(base),
            'odom': messages.odometry_template(odom, base),
            'fin_wrench': messages.wrench_template(base, lambda state: state.wrench),
            'left_fin/wrench': messages.wrench_template(base, lambda state: state.fin_wrenches[0]),
            'right_fin/wrench': messages.wrench_template(base, lambda state: state.fin_wrenches[1]),
            'imu/data': messages.imu_template(settings.imu, model, base),
            'pressure': messages.pressure_template(settings.pressure, model, base),
        }
        self._transform = (
            None if self._transform_class is None else messages.transform_template(self._transform_class, odom, base))
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
