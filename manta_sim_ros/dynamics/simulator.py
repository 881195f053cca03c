"""The simulation: `Simulator` advances a state in time, `fin_dynamics` evaluates one fin."""

from __future__ import annotations

import dataclasses
import math
import numbers
import warnings
from collections.abc import Callable, Sequence
from types import ModuleType

import numpy as np

from manta_sim_ros.dynamics._kernels import monolithic, staggered
from manta_sim_ros.dynamics._kernels.compilation import announced_compilation, machine_code
from manta_sim_ros.dynamics._kernels.constants import constants, with_servos
from manta_sim_ros.dynamics._kernels.inputs import NO_WRENCH, Inputs, wrench_of
from manta_sim_ros.dynamics._kernels.layout import Workspace, workspace
from manta_sim_ros.dynamics._kernels.motion import FASTEST, FIN_DIVERGED, NO_SOLUTION, FinState, Outcome, motion_of
from manta_sim_ros.dynamics.command import (
    REST,
    SIDES,
    FinCommand,
    check_gait,
    check_present_gait,
    check_taking_over,
    check_transition,
    servo_targets,
)
from manta_sim_ros.dynamics.current import deviation_at, steps_left
from manta_sim_ros.dynamics.parameters import MONOLITHIC, SEQUENTIAL, Parameters, check_parameters
from manta_sim_ros.dynamics.quantity import FloatArray, shown
from manta_sim_ros.dynamics.stability import (
    ModelWarning,
    StabilityWarning,
    body_warning,
    remedy,
    step_warning,
    turn_warning,
)
from manta_sim_ros.dynamics.state import MOST_STEPS, State, check_shape, finite_array

WHOLE_STEPS_TOLERANCE = 1e-6
"""Largest difference of a duration from a whole number of steps, in steps: the rounding of decimal fractions."""

LINK_STEPS_AT_ONCE = 5_000_000
"""Steps times links in one compiled call, about a second of computing: Ctrl-C takes effect between two calls."""

_NO_DEVIATION = np.zeros(3)  # of the current
_KERNELS: dict[str, ModuleType] = {SEQUENTIAL: staggered, MONOLITHIC: monolithic}
_advance: dict[str, Callable[..., tuple[int, int, int, int]]] = {}
"""The machine code that takes steps with each coupling: the types of its arguments are the same in all simulators."""


class DivergenceError(ValueError):
    """The motion diverged: a joint passed +-pi or is not finite, or the body is faster than any robot."""


class Simulator:
    """The robot in the water: takes commands of its fins and advances in time.

    A ModelWarning is given when the body has added mass but no damping in roll and yaw, and once when fins that do not
    resist twist become unstable along the chord in a turn.

    Parameters
    ----------
    parameters
        All values of the model.
    state
        The state to start from; by default at rest at the origin with flat fins, at time 0.

    Raises
    ------
    ValueError
        `state` does not fit `parameters`.

    """

    _step_too_large = False  # for the gaits of the last command
    _turn_warning: str | None = None
    _workspace: Workspace | None = None  # until the first step

    def __init__(self, parameters: Parameters | None = None, state: State | None = None) -> None:
        self._parameters = Parameters() if parameters is None else parameters
        check_parameters(self._parameters)
        self._constants = constants(self._parameters)
        self._servo_constants = with_servos(self._constants)
        self._mean_current = np.array(self._parameters.water.current)
        warning = body_warning(self._parameters)
        if warning is not None:
            self._warn(warning, ModelWarning, stacklevel=2)
        self._go_to(state)

    @property
    def parameters(self) -> Parameters:
        """The values of the model."""
        return self._parameters

    @property
    def state(self) -> State:
        """The present state."""
        return self._state

    def reset(self, state: State | None = None) -> State:
        """Continue from `state`, by default from rest at the origin at time 0, and return it.

        Raises
        ------
        ValueError
            `state` does not fit the parameters: another number of chains or links, a joint beyond +-pi, an impossible
            gait, or a moving body with `solver.fixed_base`. The simulator then keeps its state.

        """
        return self._go_to(state)

    def _go_to(self, state: State | None) -> State:
        if state is None:
            self._continue_from(State.at_rest(self._parameters))
            return self._state
        check_shape(self._parameters, state)
        if self._parameters.solver.fixed_base and (np.any(state.twist) or np.any(state.acceleration)):
            raise ValueError(
                f'state.twist is {state.twist} and state.acceleration {state.acceleration}, but solver.fixed_base asks '
                'for zeros'
            )
        largest = float(np.abs(state.joint_angles).max())
        if not largest < math.pi:
            raise ValueError(f'state.joint_angles reach {largest:g} rad, but must stay below pi')
        commands = [FinCommand(*values) for values in state.gait_commands.tolist()]
        for side, command in enumerate(commands):
            check_gait(self._parameters.rods, side, command)
            check_present_gait(self._parameters.rods, side, state.gait[side])  # the transition was checked before
        step = self._parameters.solver.time_step
        if state.time != state.start_time + state.step_count * step:  # its steps were counted elsewhere
            state = dataclasses.replace(state, start_time=state.time, step_count=0)
        warning = step_warning(self._parameters, *commands)
        self._continue_from(state)
        self._warn_of_step(warning, stacklevel=4)
        return state

    def command(self, *, left: FinCommand, right: FinCommand) -> None:
        """Command the gaits of both fins from now on; they are smoothed with `rods.command_time_constant`.

        A StabilityWarning is given when `solver.time_step` is above the `largest_stable_step` of these gaits, as it is
        for the gaits of a state. A controller that repeats them is warned once, until a stable gait comes in between.

        Raises
        ------
        ValueError
            A gait is impossible, or cannot be reached from the present one; names side, value and bound. No fin is then
            commanded.

        """
        gait, rates = self._state.gait.copy(), self._state.gait_rates.copy()
        rods = self._parameters.rods
        for side, command in enumerate((left, right)):
            if not isinstance(command, FinCommand):
                raise ValueError(f'the {SIDES[side]} command is {shown(command)}, but must be a FinCommand')
            check_gait(rods, side, command)
            check_transition(rods, side, gait[side], rates[side], command)
        commands = np.array([left.as_array(), right.as_array()])
        if rods.command_time_constant == 0.0:
            gait, rates = commands, np.zeros_like(rates)
        warning = step_warning(self._parameters, left, right)
        self._commanded(gait, rates, commands, servos=False)
        self._warn_of_step(warning, stacklevel=3)

    def command_rods(
        self, *, left: Sequence[float] | FloatArray, right: Sequence[float] | FloatArray,
    ) -> None:
        """Command the angles of the rods, in place of gaits, until the next `command`; servos turn the rods there.

        The servos are of second order, critically damped with `rods.servo_time_constant`, and not faster than
        `rods.servo_rate_limit`. Angles so far apart that the support would not close are held at the largest difference
        that has a margin, their mean as commanded: `state.rod_command` has what is in force. The rods keep that
        difference on their way, too.

        Parameters
        ----------
        left, right
            (2,) front and rear angle [rad], positive with the tip of the fin up, within +-pi/2.

        Raises
        ------
        ValueError
            An angle is not finite or out of its bounds; the rods cannot be taken over from the present gait, because
            the support would not close; or the time constant is below `solver.time_step`. No fin is then commanded.

        """
        rods, solver, before = self._parameters.rods, self._parameters.solver, self._state
        if rods.servo_time_constant < solver.time_step:
            raise ValueError(
                f'rods.servo_time_constant is {rods.servo_time_constant:g} s, but must be at least solver.time_step, '
                f'{solver.time_step:g} s, for a command of the rods')
        gait, rates, commands = np.zeros((2, 5)), np.zeros((2, 5)), np.zeros((2, 5))
        for side, angles in enumerate((left, right)):
            commands[side, 3:] = servo_targets(rods, side, angles)
        if before.servos:
            gait, rates = before.gait, before.gait_rates
        else:
            gait[:, 3:], rates[:, 3:] = before.rod_angles, before.rod_rates
            for side in range(2):
                check_taking_over(rods, side, gait[side, 3:], rates[side, 3:])
        self._commanded(gait, rates, commands, servos=True)
        self._step_too_large = False

    def _warn_of_step(self, warning: str | None, stacklevel: int) -> None:
        warned, self._step_too_large = self._step_too_large, warning is not None
        if warning is not None and not warned:
            self._warn(warning, StabilityWarning, stacklevel)

    def advance(
        self, duration: float, *, current: Sequence[float] | FloatArray | None = None,
        body_wrench: Sequence[float] | FloatArray | None = None,
        world_wrench: Sequence[float] | FloatArray | None = None,
    ) -> State:
        """Advance by `duration` [s], a whole number of time steps, in one compiled loop; return the new state.

        Parameters
        ----------
        duration
            [s].
        current
            (3,) mean velocity of the water during `duration` [m/s], world frame, in place of `water.current`.
        body_wrench, world_wrench
            (6,) external force [N] and moment [N m] on the body about its center of mass during `duration`, components
            in the body frame and in the world frame. They have no effect with `solver.fixed_base`.

        Raises
        ------
        ValueError
            `duration` is negative, not finite or not a whole number of steps; a current or wrench has a wrong shape or
            is not finite.
        DivergenceError
            The motion diverged; gives time, fin, chain and a time step to try. The simulator keeps the state that it
            had before.

        """
        steps = self._whole_steps('duration', duration)
        before, water, time_step = self._state, self._parameters.water, self._parameters.solver.time_step
        mean = self._mean_current if current is None else finite_array('current', current, (3,))
        on_body = NO_WRENCH if body_wrench is None else wrench_of(finite_array('body_wrench', body_wrench, (6,)))
        in_world = NO_WRENCH if world_wrench is None else wrench_of(finite_array('world_wrench', world_wrench, (6,)))
        motion = self._motion.copy()
        at_once = max(1, LINK_STEPS_AT_ONCE // before.joint_angles.size)
        varying = any(water.current_deviation)
        deviation = before.current_deviation if varying else _NO_DEVIATION
        taken, time = 0, before.time
        while True:
            due = min(steps - taken, at_once, steps_left(time, time_step) if varying else steps)
            water_velocity = mean + deviation if varying else mean
            outcome = self._take_steps(Inputs(tuple(water_velocity.tolist()), on_body, in_world), motion, due)
            if outcome.failure:
                raise self._divergence(before, taken, outcome)
            taken += due
            began, time = time, before.start_time + (before.step_count + taken) * time_step
            if varying:
                deviation = deviation_at(water, deviation, began, time)
            if taken == steps:
                break
        self._go_on(
            motion, time=time, step_count=before.step_count + steps, current_deviation=deviation, servos=before.servos)
        self._warn_of_turn()
        return self._state

    def _continue_from(self, state: State) -> None:
        self._state, self._motion = state, state.motion_values()

    def _commanded(self, gait: FloatArray, rates: FloatArray, commands: FloatArray, *, servos: bool) -> None:
        """Continue from the present state with other gaits, or other angles of the rods with servos."""
        before, motion = self._state, self._motion.copy()
        parts = motion_of.py_func(motion, *before.joint_angles.shape[1:])
        parts.gait[:], parts.gait_rates[:], parts.gait_commands[:] = gait, rates, commands
        self._go_on(
            motion, time=before.time, step_count=before.step_count, current_deviation=before.current_deviation,
            servos=servos)

    def _go_on(
        self, motion: FloatArray, *, time: float, step_count: int, current_deviation: FloatArray, servos: bool,
    ) -> None:
        """Continue from the values of another motion, after a command or steps; nobody else changes these."""
        before = self._state
        self._state, self._motion = State.unchecked(
            motion, before.joint_angles.shape, time=time, start_time=before.start_time, step_count=step_count,
            current_deviation=current_deviation, servos=servos), motion

    def _take_steps(self, acting: Inputs, motion: FloatArray, steps: int) -> Outcome:
        """Take steps in place; the first call with a coupling may have to compile its kernel."""
        coupling = self._parameters.solver.coupling
        values = self._servo_constants if self._state.servos else self._constants
        if self._workspace is None:
            fin = self._parameters.fin
            self._workspace = workspace(fin.chains, fin.links, coupling == MONOLITHIC)
        arguments = values, acting, motion, self._workspace, steps
        if coupling not in _advance:
            with announced_compilation():
                _advance[coupling] = machine_code(_KERNELS[coupling].advance, *arguments)
        return Outcome(*_advance[coupling](*arguments))

    @property
    def turn_warning(self) -> str | None:
        """The warning of chordwise instability in a turn that was given, if any."""
        return self._turn_warning

    def _warn_of_turn(self) -> None:
        if self._turn_warning is None:
            self._turn_warning = turn_warning(self._parameters, self._state)
            if self._turn_warning is not None:
                self._warn(self._turn_warning, ModelWarning, stacklevel=3)

    def _warn(self, message: str, category: type[Warning], stacklevel: int) -> None:
        warnings.warn(message, category, stacklevel + 1)

    def _whole_steps(self, name: str, duration: float) -> int:
        time_step = self._parameters.solver.time_step
        longest = MOST_STEPS * time_step
        real = isinstance(duration, (float, numbers.Real)) and not isinstance(duration, bool)  # the faster one first
        if not (real and 0.0 <= duration <= longest):
            raise ValueError(f'{name} is {shown(duration)}, but must be a number from 0 to {longest:g} s')
        steps = round(duration / time_step)
        if abs(duration / time_step - steps) > WHOLE_STEPS_TOLERANCE:
            raise ValueError(
                f'{name} is {shown(duration)} s, but must be a whole number of steps of solver.time_step, '
                f'{time_step!r} s; the nearest is {steps * time_step!r} s'
            )
        return steps

    def _divergence(self, before: State, taken: int, outcome: Outcome) -> DivergenceError:
        time_step = self._parameters.solver.time_step
        time = before.start_time + (before.step_count + taken + outcome.steps + 1) * time_step
        where = (
            f'a joint of chain {outcome.chain} of the {SIDES[outcome.side]} fin passed +-pi or is not finite'
            if outcome.failure == FIN_DIVERGED
            else 'the accelerations are no longer finite'
            if outcome.failure == NO_SOLUTION
            else f'the body moves faster than {FASTEST:g} m/s or rad/s'
        )
        what_to_do = remedy(self._parameters, *(FinCommand(*command) for command in before.gait_commands))
        return DivergenceError(
            f'at {time:.6g} s {where}: solver.time_step is {time_step:g} s, too large for this motion; {what_to_do}')


def compile_kernels(parameters: Parameters, announce: Callable[[str], object]) -> None:
    """Compile or load the kernels that a simulation needs; `announce` gets one line if they must be compiled."""
    with announced_compilation(announce):
        simulator = Simulator(parameters)
        simulator.command(left=REST, right=REST)
        simulator.advance(0.0)


def fin_dynamics(
    parameters: Parameters,
    side: int,
    rod_motion: FloatArray,
    joint_angles: FloatArray,
    joint_rates: FloatArray,
    body_twist: FloatArray,
    body_acceleration: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Evaluate (6) to (33) for one fin under still water, in any state, with its added mass and twist if it has any.

    Parameters
    ----------
    parameters
        All values of the model.
    side
        0 left, 1 right.
    rod_motion
        (2, 3) rows front, rear; columns angle [rad], rate [rad/s], acceleration [rad/s^2].
    joint_angles, joint_rates
        (n, m) [rad], [rad/s]. Angles beyond +-pi are taken back by full turns, and refused of a fin that resists twist.
    body_twist, body_acceleration
        (6,) linear part first, and the derivative of its components; in F_b, not mirrored.

    Returns
    -------
    tuple
        Joint accelerations (n, m) [rad/s^2], and the wrench (6,) [N, N m] of the fin on the body about the center of
        mass, in F_b.

    Raises
    ------
    ValueError
        `side` is not 0 or 1, an array has a wrong shape or is not finite, a joint of a fin that resists twist is beyond
        +-pi, the support does not close, or the motion is so fast that the result is not finite.

    """
    check_parameters(parameters)
    if isinstance(side, bool) or not isinstance(side, numbers.Integral) or side not in (0, 1):
        raise ValueError(f'side is {shown(side)}, but must be 0 (left) or 1 (right)')
    rods, joints = parameters.rods, (parameters.fin.chains, parameters.fin.links)
    rod_motion = finite_array('rod_motion', rod_motion, (2, 3))
    angles = finite_array('joint_angles', joint_angles, joints)
    largest = float(np.abs(angles).max())
    if parameters.fin.shear_modulus > 0.0 and not largest <= math.pi:
        raise ValueError(
            f'joint_angles reach {largest:g} rad, but must be within +-pi with fin.shear_modulus above 0: a full turn '
            'is no period of the twist')
    wrapped = angles - 2 * math.pi * np.round(angles / (2 * math.pi))  # the period of stiffness and geometry
    rates = finite_array('joint_rates', joint_rates, joints)
    twist = finite_array('body_twist', body_twist, (6,))
    acceleration = finite_array('body_acceleration', body_acceleration, (6,))
    (front_y, rear_y), (front_z, rear_z) = (
        (rods.front_radius * f(rod_motion[0, 0]), rods.rear_radius * f(rod_motion[1, 0])) for f in (math.cos, math.sin)
    )
    apart = math.hypot(front_y - rear_y, front_z - rear_z)
    if not apart < rods.support_length:
        raise ValueError(
            f'rod_motion sets the rod ends {apart:g} m apart in the y-z plane, but the support closes only below '
            f'rods.support_length, {rods.support_length:g} m'
        )
    fin = FinState(rod_motion, wrapped, rates, twist, acceleration, np.empty(joints))
    with announced_compilation():
        force, moment = _KERNELS[parameters.solver.coupling].evaluate(
            constants(parameters), int(side), fin, workspace(*joints, parameters.solver.coupling == MONOLITHIC))
    wrench = np.array(force + moment)
    if not (np.isfinite(fin.joint_accelerations).all() and np.isfinite(wrench).all()):
        raise ValueError('the motion is too fast: joint accelerations or wrench are not finite')
    return fin.joint_accelerations, wrench
