"""The largest stable time step of a gait, estimated from the linearized equations, without simulating it.

Chains are linearized about the straight shape, M q-ddot + C q-dot + K q = 0, with the slope of the drag (12) at the
speeds that the gait gives the links (`harmonic`, which also explains the letters). The largest step is the one at which
the scheme still damps these equations: the classical Runge-Kutta scheme and, with a free body, the coupling.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from manta_sim_ros.dynamics._kernels.geometry import rotate_back, rotation_of
from manta_sim_ros.dynamics.command import HIGHEST_FREQUENCY, SIDES, FinCommand, check_gait
from manta_sim_ros.dynamics.harmonic import (
    STATIONS,
    STEEPEST_BEND,
    StraightFins,
    body_damping,
    body_inertia,
    flow_motion,
    gait_motion,
    straight_fins,
)
from manta_sim_ros.dynamics.parameters import SEQUENTIAL, Parameters, Solver, check_parameters
from manta_sim_ros.dynamics.quantity import FloatArray, shown
from manta_sim_ros.dynamics.state import State

SPEED_SHARE = 0.85
"""Share of a speed's amplitude at which the drag is linearized; calibrated in evidence/verification/stability.py."""

SAFETY = 0.95
"""Factor on the estimate, so that it is on the safe side; calibrated in evidence/verification/stability.py."""

HARMLESS_GROWTH = 1.0
"""Largest growth rate [1/s] of a stable disturbance: forward Euler lets slow motions of the body grow a little."""

SAFE_SHARE, SAFE_SHARE_OF_ONE_LINK = 0.9, 0.3
"""Share of the step of larger gaits up to which a gait is not examined by itself; a test tries random gaits.

With one link per chain, a smaller motion may need a smaller step.
"""

AMPLITUDE_CELL, FREQUENCY_CELL = 0.1, 0.25
PHASES = (-0.7, 0.0, 0.7)
"""Grid of the larger gaits [rad], [Hz], and their phases [rad]."""

STEPS_PER_PERIOD = 50.0
"""Fewer steps per period do not resolve a gait, whether they are stable or not."""

MOST_LINKS_WITH_BODY = 6
"""Links per chain up to which fins and body are examined together: with more, the stiffness of the chains decides."""

LEAST_STEP = Solver.quantities()['time_step'].low
UNREACHABLE = f', but solver.time_step must be at least {LEAST_STEP:g} s: make the fins softer, or use fewer links'

DIRECTIONS = np.linspace(0.5 * math.pi, math.pi, 1025)
"""Arguments of the eigenvalues [rad] at which the stability region is tabulated; it is symmetric."""

SHARED, OPPOSITE = (0, 2, 4), (1, 3, 5)
"""Axes of the twist in which both fins move alike (x, z, pitch), and those in which they move oppositely."""


def largest_stable_step(parameters: Parameters, left: FinCommand, right: FinCommand) -> float:
    """Return an estimate of the largest `solver.time_step` [s] at which these gaits are stable once they are periodic.

    The page "Verification" of the documentation compares it with the steps at which simulations diverge. It is not
    reliable for chains of one or two links, nor for fins with chordwise instability (page "Model"), which need smaller
    steps. The estimate is 0 if no step is stable, because the fins are too heavy against the body for `solver.coupling`
    sequential. It is infinite if nothing limits the step, as for free joints at rest without damping and water. The
    value of `solver.time_step` itself has no influence.

    Raises
    ------
    ValueError
        A gait is impossible; names side, value and bound.

    """
    check_parameters(parameters)
    for side, command in enumerate((left, right)):
        if not isinstance(command, FinCommand):
            raise ValueError(f'the {SIDES[side]} command is {shown(command)}, but must be a FinCommand')
        check_gait(parameters.rods, side, command)
    return _largest_stable_step(parameters, left, right)


class StabilityWarning(UserWarning):
    """`solver.time_step` is above the largest stable step of the commanded gaits."""


class ModelWarning(UserWarning):
    """The parameters let the robot move as no robot does, whatever the time step."""


def body_warning(parameters: Parameters) -> str | None:
    """Return a warning if the body has added mass but no damping in roll and yaw, else None."""
    body = parameters.body
    undamped = [
        name for axis, name in ((3, 'roll'), (5, 'yaw'))
        if body.linear_damping[axis] == 0.0 and body.quadratic_damping[axis] == 0.0]
    if not any(body.added_mass) or not undamped:
        return None
    return (
        f'body.added_mass is {list(body.added_mass)}, but there is no damping in {" and ".join(undamped)}: the robot '
        'will tumble; set the values for roll and yaw of body.linear_damping or body.quadratic_damping above 0')


def turn_warning(parameters: Parameters, state: State) -> str | None:
    """Return a warning if the fins have chordwise instability in a turn, else None.

    A fin in a flow U along its chord is unstable if U > omega_1 L / n, where omega_1 is the first natural frequency of
    a chain, unless it resists twist.
    """
    fin, rods = parameters.fin, parameters.rods
    left, right = state.gait_commands.tolist()
    if fin.shear_modulus > 0.0 or parameters.solver.fixed_base or left == right:
        return None
    current = rotate_back.py_func(rotation_of.py_func(state.orientation.tolist()), parameters.water.current)
    lateral = abs(rods.rear_motor_position[1]) + rods.rear_radius + 0.5 * fin.span  # of the middle of a fin
    speed = abs(float(state.twist[0]) - current[0]) + lateral * abs(float(state.twist[5]))  # of the faster fin
    critical = _critical_speed(parameters)
    if speed <= critical:
        return None
    return (
        f'the fins have chordwise instability in this turn: they move at {speed:.2g} m/s, and without resistance to '
        f'twist they are stable up to {critical:.2g} m/s only, so that fin.chains, {fin.chains}, decides how the robot '
        'turns; set fin.shear_modulus, as in config/freshwater.yaml')


@functools.lru_cache(maxsize=16)
def _critical_speed(parameters: Parameters) -> float:
    """Return omega_1 L / n [m/s]."""
    fins = straight_fins(parameters)
    largest = np.linalg.eigvalsh(fins.inertia)[-1]  # all joints are equally stiff
    return parameters.rods.support_length / parameters.fin.chains * math.sqrt(fins.stiffness / largest)


def rounded_down(step: float) -> float:
    """Return a step [s], above 0, with two digits, not above it."""
    unit = 10.0 ** (math.floor(math.log10(step)) - 1)
    return float(f'{math.floor(step / unit) * unit:.2g}')


def step_warning(parameters: Parameters, left: FinCommand, right: FinCommand) -> str | None:
    """Return a warning if `solver.time_step` is too large for these gaits, else None.

    This is cheap if the step is small enough for all gaits of about this size and frequency, as controllers command new
    gaits at a high rate.
    """
    time_step = parameters.solver.time_step
    share = SAFE_SHARE if parameters.fin.links > 1 else SAFE_SHARE_OF_ONE_LINK
    if time_step <= share * _step_of_larger_gaits(parameters, left, right):
        return None
    largest = largest_stable_step(parameters, left, right)
    if time_step <= largest:
        return None
    if largest == 0.0:
        return (
            f'solver.time_step is {time_step:g} s, but the largest stable step is 0 s: the fins are too heavy '
            'against the body for solver.coupling sequential; set it to monolithic'
        )
    return (
        f'solver.time_step is {time_step:g} s, but the largest stable step of this gait is about '
        f'{rounded_down(largest):g} s: the simulation may diverge{"" if largest >= LEAST_STEP else UNREACHABLE}'
    )


def remedy(parameters: Parameters, left: FinCommand, right: FinCommand) -> str:
    """Return advice for a simulation of these gaits that diverged."""
    time_step, largest = parameters.solver.time_step, largest_stable_step(parameters, left, right)
    if largest == 0.0:
        return 'no step is stable with solver.coupling sequential, set it to monolithic'
    if largest < LEAST_STEP:
        return f'about {rounded_down(largest):g} s is stable{UNREACHABLE}'
    return f'try {rounded_down(largest) if largest < time_step else 0.5 * time_step:g} s'


def _step_of_larger_gaits(parameters: Parameters, left: FinCommand, right: FinCommand) -> float:
    """Return the smallest of the largest stable steps [s] of gaits that are at least as large and as fast as these.

    Both fins have the same gait, with the next amplitude and frequency of a grid, and some phases.
    """
    amplitude, frequency = (
        math.ceil(max(getattr(left, name), getattr(right, name)) / cell) * cell
        for name, cell in (('amplitude', AMPLITUDE_CELL), ('frequency', FREQUENCY_CELL)))
    return _step_of_phases(parameters, min(amplitude, 0.5 * math.pi), min(frequency, HIGHEST_FREQUENCY))


@functools.lru_cache(maxsize=512)
def _step_of_phases(parameters: Parameters, amplitude: float, frequency: float) -> float:
    """Return the smallest of the largest stable steps [s] of gaits of both fins with some phases."""
    gaits = (FinCommand(amplitude, frequency, phase) for phase in PHASES)
    return min(_largest_stable_step(parameters, gait, gait) for gait in gaits)


@functools.lru_cache(maxsize=2048)
def _largest_stable_step(parameters: Parameters, left: FinCommand, right: FinCommand) -> float:
    fins = straight_fins(parameters)
    none = np.zeros(parameters.fin.links)
    speeds, angles, body_speeds = gait_motion(parameters, fins, (left, right))
    flow, deflection = flow_motion(parameters, fins)
    drag, stiffness = _slopes(fins, SPEED_SHARE * speeds + flow, np.maximum(angles, deflection))
    waves = 2.0 - 2.0 * math.cos(math.pi * (1.0 - 1.0 / parameters.fin.chains))  # of the shortest mode along the chord
    step = min(
        _chain_step(fins, *slopes, wave) for wave in {0.0, waves if fins.twist_stiffness or fins.twist_damping else 0.0}
        for slopes in (_slopes(fins, none, none), (drag, stiffness)))
    if not parameters.solver.fixed_base:
        step = _coupled_step(parameters, fins, drag, stiffness, body_damping(parameters, body_speeds), step)
    frequency = max(gait.frequency if gait.amplitude > 0.0 else 0.0 for gait in (left, right))
    return min(SAFETY * step, 1.0 / (STEPS_PER_PERIOD * frequency) if frequency > 0.0 else math.inf)


def _slopes(fins: StraightFins, speeds: FloatArray, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the slopes (m,) of the drag (12) at normal speeds [m/s] and of the elastic torque (14) at angles [rad]."""
    t2 = np.tan(0.5 * np.minimum(angles, STEEPEST_BEND)) ** 2
    return 2.0 * fins.drag * speeds, fins.stiffness * (1.0 + t2) * (1.0 + 3.0 * t2)


def _chain_step(fins: StraightFins, drag: FloatArray, stiffness: FloatArray, wave: float) -> float:
    """Return the largest stable step [s] of a chain on a support whose motion is given.

    `wave` is the eigenvalue of the second difference along the chord, 2 - 2 cos(pi i / n) for its mode i.
    """
    return _runge_kutta_step(
        fins.inertia,
        fins.damping + fins.normal.T @ (drag[:, None] * fins.normal) + wave * fins.twist_damping * fins.twist,
        np.diag(stiffness) + wave * fins.twist_stiffness * fins.twist)


def _coupled_step(
    parameters: Parameters, fins: StraightFins, drag: FloatArray, stiffness: FloatArray, resistance: FloatArray,
    longest: float,
) -> float:
    """Return the largest stable step [s], at most `longest`, of fins and body together.

    `resistance` (6,) is the damping of the body by the water.

    B is linear along a support, so chains stay a sum of two that are shaped alike: one shape uniform, one linear in s.
    """
    J, B, m = fins.normal, fins.body[0], 2 * len(fins.normal)
    shapes = np.stack((np.ones(STATIONS), fins.station - 0.5), axis=1)
    alike, both = 2.0 * fins.chord * shapes.T @ shapes, 2.0 * fins.chord
    twisted = 2.0 * parameters.rods.support_length / parameters.fin.chains**2 * np.diag((0.0, 1.0))  # slopes squared
    inertia, damping, elastic = np.zeros((3, m + 6, m + 6))
    inertia[:m, :m] = np.kron(alike, fins.inertia)
    damping[:m, :m] = np.kron(alike, fins.damping + J.T @ (drag[:, None] * J))
    damping[:m, :m] += fins.twist_damping * np.kron(twisted, fins.twist)
    elastic[:m, :m] = np.kron(alike, np.diag(stiffness)) + fins.twist_stiffness * np.kron(twisted, fins.twist)
    inertia[:m, m:] = both * np.einsum('sp,sja->pja', shapes, fins.coupling).reshape(m, 6)
    damping[:m, m:] = both * np.einsum('sp,sja->pja', shapes, J.T @ (drag[:, None] * B)).reshape(m, 6)
    inertia[m:, :m], damping[m:, :m] = inertia[:m, m:].T, damping[:m, m:].T
    inertia[m:, m:] = fins.rigid
    damping[m:, m:] = both * np.einsum('sja,sjb->ab', drag[:, None] * B, B) + np.diag(resistance)
    own = body_inertia(parameters)
    together = parameters.fin.links <= MOST_LINKS_WITH_BODY
    for axes in (SHARED, OPPOSITE):
        kept = np.ix_(*2 * ([*range(m), *(m + axis for axis in axes)],))
        fin_matrices, own_here = (inertia[kept], damping[kept], elastic[kept]), own[list(axes)]
        if parameters.solver.coupling == SEQUENTIAL:
            if _too_heavy(fin_matrices[0], own_here):
                return 0.0
            longest = _staggered_step(*fin_matrices, own_here, longest) if together else longest
        elif together:
            fin_matrices[0][m:, m:] += np.diag(own_here)
            longest = min(longest, _runge_kutta_step(*fin_matrices))
    return longest


def _staggered_step(
    inertia: FloatArray, damping: FloatArray, stiffness: FloatArray, own: FloatArray, longest: float,
) -> float:
    """Return the largest stable step [s], at most `longest`, of the staggered coupling; the body has the inertia `own`.

    The last three rows of the fins' matrices are the body's.
    """
    if longest == math.inf:
        return longest
    low, high = 0.0, math.inf
    for tried in (longest / 8.0, longest / 4.0, longest / 2.0, longest):  # stable steps can be above unstable ones
        if _growth_rate(inertia, damping, stiffness, own, tried) > HARMLESS_GROWTH:
            high = tried
            break
        low = tried
    while low < longest and high - low > 0.02 * high and high > LEAST_STEP:
        middle = 0.5 * (low + high)
        if _growth_rate(inertia, damping, stiffness, own, middle) <= HARMLESS_GROWTH:
            low = middle
        else:
            high = middle
    return low if low > 0.0 else high


def _too_heavy(inertia: FloatArray, own: FloatArray) -> bool:
    """Return whether fins with free joints are as heavy as the body, whose acceleration is one step old for them."""
    joints = slice(0, -3)
    at_body = inertia[-3:, -3:] - inertia[-3:, joints] @ np.linalg.solve(inertia[joints, joints], inertia[joints, -3:])
    root = np.sqrt(own)
    return bool(np.linalg.eigvalsh(at_body / root / root[:, None])[-1] >= 1.0)


def _growth_rate(
    inertia: FloatArray, damping: FloatArray, stiffness: FloatArray, own: FloatArray, dt: float,
) -> float:
    """Return the rate [1/s] at which the worst disturbance grows in steps of `dt` [s] of the staggered coupling."""
    m = len(inertia) - 3
    twist = slice(2 * m, 2 * m + 3)  # of the state: joint angles, joint rates, twist, acceleration of the body
    accelerations = -np.linalg.solve(
        inertia[:m, :m], np.concatenate((stiffness[:m, :m], damping[:m, :m], damping[:m, m:], inertia[:m, m:]), axis=1))
    z = np.zeros((2 * m + 6, 2 * m + 6))
    z[:m, m:2 * m] = dt * np.eye(m)
    z[m:2 * m] = dt * accelerations
    one = np.eye(2 * m + 6)
    moved = one + z @ (one + z @ (one + z @ (one + z / 4.0) / 3.0) / 2.0)  # Runge-Kutta, the body's motion held
    force = -inertia[m:, :m] @ accelerations @ moved - damping[m:, :m] @ moved[m:2 * m]
    force[:, twist] -= damping[m:, m:]
    force[:, -3:] -= inertia[m:, m:]
    step = moved.copy()
    step[-3:] = force / own[:, None]
    step[twist] += dt * step[-3:]
    return math.log(max(np.abs(np.linalg.eigvals(step)).max(), 1e-300)) / dt


def _runge_kutta_step(inertia: FloatArray, damping: FloatArray, stiffness: FloatArray) -> float:
    """Return the largest stable step [s] of M q-ddot + C q-dot + K q = 0 with classical Runge-Kutta."""
    size = len(inertia)
    system = np.zeros((2 * size, 2 * size))
    system[:size, size:] = np.eye(size)
    system[size:] = -np.linalg.solve(inertia, np.concatenate((stiffness, damping), axis=1))
    eigenvalues = np.linalg.eigvals(system)
    sizes = np.abs(eigenvalues)
    if not sizes.max() > 0.0:
        return math.inf
    reach = np.interp(np.abs(np.angle(eigenvalues)), DIRECTIONS, _reach())
    return float(np.min(reach / np.maximum(sizes, 1e-9 * sizes.max())))


@functools.cache
def _reach() -> FloatArray:
    """Return the largest |z| in `DIRECTIONS` with |R(z)| <= 1, R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24."""
    low, high = np.zeros(DIRECTIONS.size), np.full(DIRECTIONS.size, 4.0)  # each ray leaves the region once
    for _ in range(50):
        middle = 0.5 * (low + high)
        z = middle * np.exp(1j * DIRECTIONS)
        inside = np.abs(1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0)))) <= 1.0
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low
