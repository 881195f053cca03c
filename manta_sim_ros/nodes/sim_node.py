"""The node `manta_sim`: takes fin commands, advances the dynamics, and publishes the state and the clock."""

from __future__ import annotations

import importlib
import math
import time
import warnings
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.context import Context
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.executors import Executor
from rclpy.parameter import Parameter
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from manta_sim_ros.dynamics import (
    FinCommand,
    FloatArray,
    ModelWarning,
    StabilityWarning,
    State,
    body_warning,
    compile_kernels,
    immersed_shares,
    largest_stable_step,
    step_warning,
)
from manta_sim_ros.nodes import messages
from manta_sim_ros.nodes.diagnostics import Health, statuses
from manta_sim_ros.nodes.disturbances import Disturbances
from manta_sim_ros.nodes.leader_clock import FOLLOWS, LeaderClock
from manta_sim_ros.nodes.outputs import Outputs
from manta_sim_ros.nodes.parameters import ParameterNode, declare, set_values
from manta_sim_ros.nodes.process import executor, run_node, run_waiting
from manta_sim_ros.nodes.qos import Input, publisher
from manta_sim_ros.nodes.refusals import Refusals
from manta_sim_ros.nodes.robot import Robot
from manta_sim_ros.nodes.settings import NodeParameters, Settings
from manta_sim_ros.nodes.time_control import TimeControl

REPORT_PERIOD = 1.0  # s, as all below
SHORTEST_WINDOW = 0.5  # in which a real-time factor is measured
PACE_WARNING_PERIOD = 5.0
CLOCK_WARNING_PERIOD = 10.0
STEP_WARNING_PERIOD = 10.0
DIVERGENCE_ERROR_PERIOD = 1.0
LONGEST_WAIT = 0.1  # s
LONGEST_LISTENING = 0.005  # s, to what came before: then commands replace each other, so that time goes on


class SimNode(ParameterNode):
    """The simulated robot as a node. It publishes simulated time: first all outputs of a state, then the clock.

    Parameters
    ----------
    context
        The context in which it runs; by default that of `rclpy.init()`. Robots of one process have one each, with the
        ROS 2 arguments of that robot.

    Raises
    ------
    ValueError
        A parameter has an invalid value.

    """

    def __init__(self, context: Context | None = None) -> None:
        super().__init__('manta_sim', context)
        warnings.simplefilter('ignore', StabilityWarning)  # `_warn_of_step` logs it
        warnings.simplefilter('ignore', ModelWarning)  # `_warn_of_model` does
        self._settings: Settings = declare(self)
        self._robot = Robot(self._settings, self._report_divergence, self.get_logger().warning)
        self._refusals = Refusals(self.get_logger().warning, 'fin_command', 'the previous gait continues')
        self._rod_refusals = Refusals(self.get_logger().warning, 'rod_command', 'the rods stay as they were commanded')
        self._held = Refusals(self.get_logger().warning, 'rod_command', 'as the support must close', done='held')
        self._parameter_refusals = Refusals(self.get_logger().warning, 'parameters', 'nothing changes')
        self._step_warning, self._step_warning_due = '', -math.inf
        self._body_warned = self._turn_warned = False
        self._keeps = False  # commands, as too many came
        self._kept: dict[Callable[[Any], None], Any] = {}  # the last commands, by who takes them
        self._next_tick = math.inf  # steady time [s], as all that is due
        self._report_due = time.monotonic() + REPORT_PERIOD
        self._computing = 0.0  # elapsed time in ticks since the last diagnostics [s]
        self._divergences_reported = 0  # in the last diagnostics

        self._leader = LeaderClock(self, self._robot, lambda: self._settings)
        self._outputs = Outputs(
            self, lambda: self._settings, lambda: self._robot.mean_current, lambda: self._leader.followed)
        self._diagnostics = publisher(self, '/diagnostics')
        self._commands = Input(self, 'fin_command', self._take_command)
        self._rod_commands = Input(self, 'rod_command', self._take_rod_command)
        self._disturbances = Disturbances(self, self._robot, lambda: self._settings)
        self._time = TimeControl(
            self, self._robot, lambda: self._settings, self._leader, self._publish_steps, self._set_pace,
            self._forget_inputs)
        self._offers_standard_services = self._offer_standard_services()
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        self.warn_of_unknown_parameters()

    def start(self) -> None:
        """Compile or load the kernels, and begin to simulate."""
        if self._outputs.lacking:
            cure = ', or set publish_tf to false' if self._outputs.lacking == ['/tf'] else ''
            self.get_logger().info(
                f'no transform is published, as tf2_msgs is not installed: install it{cure}')
        if not self._offers_standard_services:
            self.get_logger().info(
                'the standard services of simulators are not offered, as simulation_interfaces is not installed')
        compile_kernels(self._settings.model, self.get_logger().info)
        self._warn_of_model()
        self._leader.begin()
        default, own = NodeParameters(), self._settings.node
        for name in ('start_paused', 'real_time_factor'):
            if self._leader.followed and getattr(own, name) != getattr(default, name):
                self.get_logger().warning(f'{name} has no effect: {FOLLOWS}')
        self._set_pace()
        self.get_logger().info(
            f'ready{" and paused" if self._time.paused else ""}: publish fin commands on {self._commands.topic_name}')

    def _offer_standard_services(self) -> bool:
        """Offer the services of simulation_interfaces; return whether that package is installed."""
        try:
            importlib.import_module('simulation_interfaces.srv')  # first: threads may see a module of ours half made
        except ModuleNotFoundError:
            return False
        from manta_sim_ros.nodes.simulation_interfaces import SimulationInterfaces

        SimulationInterfaces(
            self, self._robot, lambda: self._settings, self._leader, self._time, self._outputs.stamp)
        return True

    def spin(self, ending: Future[None] | None = None) -> None:
        """Simulate on the steady clock and run callbacks in between, until the context is shut down.

        If a future is given, `spin` also returns when that is done.

        A timer of rclpy stays in phase: ticks that take somewhat longer than their period would come at half the rate.
        """
        callbacks = executor(self.context)
        callbacks.add_node(self)
        ending = Future() if ending is None else ending
        ending.add_done_callback(lambda _: callbacks.wake())
        try:
            while self.context.ok() and not ending.done():
                self._spin_once(callbacks)
        finally:
            callbacks.shutdown()  # else it holds the entities of the node, which is not destroyed then

    def _spin_once(self, callbacks: Executor) -> None:
        began = time.monotonic()
        if self._time_to_tick(began) <= 0.0:
            self._tick()
            self._ticked_at = time.monotonic()
            self._computing += self._ticked_at - began
            self._next_tick = max(self._next_tick + self._tick_period, self._ticked_at)  # does not catch up
        elif self._time.paused or self._leader.stands_still:
            self._stand_still()
            self._listen(callbacks)
        if self._report():
            self._listen(callbacks)  # to what comes faster than one by one
        wait = self._time_to_tick(time.monotonic())
        if wait > 0.0:
            callbacks.spin_once(timeout_sec=min(wait, LONGEST_WAIT))
        else:
            self._listen(callbacks)

    def _listen(self, callbacks: Executor) -> None:
        """Run the callbacks of all that was received; of too many commands, take the last ones only."""
        if not run_waiting(callbacks, time.monotonic() + LONGEST_LISTENING):
            self._keeps = True
            run_waiting(callbacks)
            self._take_kept()
            self._keeps = False

    def _publish_steps(self, states: Iterable[State]) -> None:
        """Publish the outputs of steps, which are taken meanwhile, after the commands that came before."""
        self._take_kept()
        self._outputs.publish_all(states)

    def _time_to_tick(self, now: float) -> float:
        """Return the elapsed time until the next tick is due [s]; infinite while simulated time stands still."""
        if self._leader.followed:
            return 0.0 if self._robot.steps_until(self._leader.time) > 0 else math.inf
        return math.inf if self._time.paused else self._next_tick - now

    def _tick(self) -> None:
        if not self._leader.followed:
            self._outputs.publish(self._robot.tick())
        elif self._robot.follow(self._leader.time):
            self._outputs.publish(self._robot.state)

    def _stand_still(self) -> None:
        """Let whoever comes late know time and state."""
        if self._outputs.lacks(self._robot.state):  # the clock that is followed stopped between two outputs
            self._outputs.publish(self._robot.state)
        self._outputs.publish_to_latecomers()
        self._outputs.repeat_clock()

    def _set_pace(self) -> None:
        pace = self._settings.node.pace
        self._tick_period = 1.0 / pace if pace > 0.0 else 0.0
        self._ticked_at = time.monotonic()
        self._next_tick = self._ticked_at + self._tick_period
        self._begin_pace_window()

    def _take_command(self, message: Float64MultiArray) -> None:
        try:
            commands = messages.commands_of(message)
        except ValueError as error:
            self._refusals.add(error)
        else:
            self._now_or_last(self._command, commands)

    def _command(self, commands: tuple[FinCommand, FinCommand]) -> None:
        try:
            self._robot.command(*commands)
        except ValueError as error:
            self._refusals.add(error)
        else:
            self._warn_of_step()

    def _take_rod_command(self, message: JointState) -> None:
        try:
            angles = messages.rod_command(message, self._kept.get(self._command_rods, self._robot.rod_targets))
        except ValueError as error:
            self._rod_refusals.add(error)
        else:
            self._now_or_last(self._command_rods, angles)

    def _command_rods(self, angles: FloatArray) -> None:
        try:
            if self._robot.command_rods(angles):
                self._held.add(f'{angles.tolist()} rad, and {self._robot.rod_targets.tolist()} rad is in force')
        except ValueError as error:
            self._rod_refusals.add(error)

    def _now_or_last(self, take: Callable[[Any], None], values: Any) -> None:
        """Take a command, or keep it in place of the one before if too many came."""
        if self._keeps:
            self._kept.pop(take, None)
            self._kept[take] = values
        else:
            take(values)

    def _take_kept(self) -> None:
        """Take the commands that were kept, in the order in which they came."""
        kept, self._kept = self._kept, {}
        for take, values in kept.items():
            take(values)

    def _forget_inputs(self) -> None:
        self._commands.drain()
        self._rod_commands.drain()
        self._kept.clear()
        self._disturbances.forget()

    def _warn_of_step(self) -> None:
        """Warn if the commanded gaits need a smaller time step with the present parameters."""
        warning = step_warning(self._settings.model, *self._robot.commands)
        if warning is not None and (warning != self._step_warning or time.monotonic() > self._step_warning_due):
            self._step_warning, self._step_warning_due = warning, time.monotonic() + STEP_WARNING_PERIOD
            self.get_logger().warning(warning)

    def _warn_of_model(self) -> None:
        """Warn, once of each, if the parameters let the robot move as no robot does."""
        model = self._settings.model
        body = None if self._body_warned else body_warning(model)
        turn = None if self._turn_warned else self._robot.turn_warning
        self._body_warned |= body is not None
        self._turn_warned |= turn is not None
        for warning in (body, turn):
            if warning is not None:
                self.get_logger().warning(warning)

    def _report_divergence(self, line: str) -> None:
        self.get_logger().error(line, throttle_duration_sec=DIVERGENCE_ERROR_PERIOD)

    def _begin_pace_window(self) -> None:
        self._window_began = self._ticked_at, self._robot.state.time
        self._computing = 0.0

    def _report(self) -> bool:
        """Once a second, publish diagnostics, and warn of a machine that is too slow and of clocks.

        Return whether that was now.
        """
        now = time.monotonic()
        if now < self._report_due:
            return False
        self._report_due = now + REPORT_PERIOD
        health = self._health()
        if not math.isnan(health.reached_factor):
            self._begin_pace_window()
        self._warn_of_model()
        self._divergences_reported = self._robot.divergences
        self._diagnostics.publish(DiagnosticArray(
            header=messages.header(self._outputs.stamp(self._robot.state), ''),
            status=statuses(self.get_fully_qualified_name(), health)))
        if health.clock_trouble:
            self.get_logger().warning(health.clock_trouble, throttle_duration_sec=CLOCK_WARNING_PERIOD)
        elif not health.keeps_up:
            self.get_logger().warning(
                f'real-time factor {health.reached_factor:.2f} instead of {health.wanted_factor:g}: this machine '
                'cannot keep up, and simulated time is slower',
                throttle_duration_sec=PACE_WARNING_PERIOD,
            )
        if self._outputs.another_clock:
            self.get_logger().warning(
                'another node publishes /clock too: start all simulators but one with publish_clock false',
                throttle_duration_sec=CLOCK_WARNING_PERIOD,
            )
        return True

    def _health(self) -> Health:
        model, robot, leader = self._settings.model, self._robot, self._leader
        still = self._time.paused or leader.stands_still
        refusals = {
            'fin_command': self._refusals, 'rod_command': self._rod_refusals, 'parameters': self._parameter_refusals,
            **self._time.refusals, **self._disturbances.refusals}
        elapsed, simulated = self._ticked_at - self._window_began[0], robot.state.time - self._window_began[1]
        steps = simulated / model.solver.time_step
        power, speed = robot.transport.take()
        body_in_water, links_in_water = immersed_shares(model, robot.state)
        return Health(
            time=robot.state.time, paused=still, follows=leader.followed, clock_trouble=leader.trouble,
            wanted_factor=0.0 if leader.followed else self._settings.node.real_time_factor,
            reached_factor=math.nan if still or elapsed < SHORTEST_WINDOW else simulated / elapsed,
            computing=math.nan if still or not steps else self._computing / steps,
            commanding_topic=robot.commanding_topic, held=self._held.take(),
            command_age=robot.command_age, timed_out=robot.timed_out,
            abandoned=robot.flaps and not self.count_publishers(self._commands.topic_name),
            refused={topic: refusals_of.take() for topic, refusals_of in refusals.items()},
            current=np.add(robot.mean_current, robot.state.current_deviation),
            external_wrench=robot.has_external_wrench,
            diverged_lately=robot.divergences > self._divergences_reported, finite=robot.finite,
            time_step=model.solver.time_step, largest_step=largest_stable_step(model, *robot.commands),
            body_in_water=body_in_water, fins_in_water=float(links_in_water.mean()),
            power=power, speed=speed, weight=model.body.mass * model.body.gravity,
        )

    def set_parameters_atomically(self, parameter_list: list[Parameter[Any]]) -> SetParametersResult:
        """Set parameters as every node does, and count what is refused, whoever refuses it."""
        try:
            result = super().set_parameters_atomically(parameter_list)
        except ParameterNotDeclaredException as error:
            self._parameter_refusals.count(str(error))
            raise
        if not result.successful:
            self._parameter_refusals.count(result.reason)
        return result

    def _check_parameters(self, parameters: list[Parameter[Any]]) -> SetParametersResult:
        try:
            if self._leader.followed and any(parameter.name == 'real_time_factor' for parameter in parameters):
                raise ValueError(f'real_time_factor cannot be set: {FOLLOWS}')
            self._robot.check(set_values(self._settings, parameters))
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_parameters(self, parameters: list[Parameter[Any]]) -> None:
        before, self._settings = self._settings, set_values(self._settings, parameters)
        self._robot.apply(self._settings)
        if any(parameter.name == 'water.current' for parameter in parameters):
            self._robot.set_current(None)
        if self._settings.model != before.model:
            self._warn_of_step()
        if self._settings.node.pace != before.node.pace and self._next_tick < math.inf:
            self._set_pace()


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    run_node(SimNode, SimNode.start, SimNode.spin, args)
