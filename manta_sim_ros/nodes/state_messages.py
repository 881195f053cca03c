"""The messages of consecutive states: which of them are due, and in which order."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from builtin_interfaces.msg import Time

from manta_sim_ros import sensors
from manta_sim_ros.dynamics import State
from manta_sim_ros.nodes import messages
from manta_sim_ros.nodes.frames import ned_templates, static_transforms
from manta_sim_ros.nodes.markers import Markers
from manta_sim_ros.nodes.settings import Settings

PATH_LENGTH = 20.0
"""Length of the path in the markers [m]: some minutes of swimming."""

ROUNDING = 1e-6  # tolerance of a number of periods: far above the rounding of a time and far below a time step


TRANSFORMS = ('/tf', '/tf_static')
"""Topics whose messages are of tf2_msgs."""


def optional_topics(settings: Settings) -> dict[str, bool]:
    """Return which topics the parameters ask for, of those that are not the messages of every state."""
    own = settings.node
    return {
        '/tf': own.publish_tf, '/tf_static': bool(static_transforms(settings)), 'pose_ned': own.publish_ned,
        'odom_ned': own.publish_ned, '/clock': own.publish_clock, '/diagnostics': False}


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
        The class of a tf2_msgs/msg/TFMessage; None leaves /tf and /tf_static out.

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
        due = [(topic, template.write(stamp, state)) for topic, template in self._every_time.items()]
        if self._before is None and self._transform_class is not None:
            transforms = static_transforms(self._settings())
            for transform in transforms:
                transform.header.stamp = stamp
            due += [('/tf_static', self._transform_class(transforms=transforms))] if transforms else []
        if self._transform is not None and stamp != self._transformed_at:
            due.append(('/tf', self._transform.write(stamp, state)))
            self._transformed_at = stamp
        if self._was_put(state):
            self._markers.forget()
        for topic, (rate, message_of) in self._rated.items():
            if self._due(state, rate) and (message := message_of(stamp, state)) is not None:
                due.append((topic, message))
        self._before, self._stamp = state, stamp
        return [*due, ('/clock', self._clock.write(stamp, state))]

    def again(self, topic: str) -> Any | None:
        """Return the message of the last state on a topic that has a rate of its own; None for the other topics."""
        self._update_templates()
        if self._before is None or topic not in self._rated:
            return None
        _, message_of = self._rated[topic]
        return message_of(self._stamp, self._before)

    def _velocity_message(self, stamp: Time, state: State) -> Any | None:
        """Return the message of a reading, None if that is missing."""
        reading = sensors.read_velocity(self._settings().velocity, state)
        return None if reading is None else self._velocity.write(stamp, reading)

    def _marker_message(self, stamp: Time, state: State) -> Any | None:
        """Return the markers, None if nobody looks at them."""
        if not self._shows_markers():
            self._markers.forget()
            return None
        settings = self._settings()
        return self._markers.write(
            state, settings.model, stamp, settings.node.base_frame, settings.node.odom_frame, self._mean_current())

    def _update_templates(self) -> None:
        """Make the templates of the messages again if a parameter has changed: names and variances depend on them."""
        settings = self._settings()
        if settings is self._templates_for:
            return
        own, model, imu, noise = settings.node, settings.model, settings.imu, settings.odom_noise
        odom, base = own.odom_frame, own.base_frame
        self._templates_for = settings
        self._every_time = {
            'pose': messages.pose_template(odom),
            'twist': messages.twist_template(base),
            'odom': messages.odometry_template(noise, odom, base),
            'fin_wrench': messages.wrench_template(base, lambda state: state.wrench),
            'left_fin/wrench': messages.wrench_template(base, lambda state: state.fin_wrenches[0]),
            'right_fin/wrench': messages.wrench_template(base, lambda state: state.fin_wrenches[1]),
            'imu/data': messages.imu_template(imu, model, settings.imu_frame),
            'pressure': messages.pressure_template(settings.pressure, model, base),
        }
        self._transform = (
            messages.transform_template(self._transform_class, odom, base)
            if self._transform_class is not None and own.publish_tf else None)
        if own.publish_ned:
            self._every_time |= ned_templates(noise, own.odom_frame_ned, own.base_frame_frd)
        self._velocity = messages.velocity_template(settings.velocity, base)
        joints = messages.joint_state_template(model, own.publish_fin_joints, base)
        self._rated: dict[str, tuple[float, Callable[[Time, State], Any]]] = {
            'velocity': (settings.velocity.rate, self._velocity_message),
            'joint_states': (own.joint_state_rate, joints.write),
            'fin_markers': (own.marker_rate, self._marker_message),
        }
        if imu.rate > 0.0:
            self._rated['imu/data'] = imu.rate, self._every_time.pop('imu/data').write

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
