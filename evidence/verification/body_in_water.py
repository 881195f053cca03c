"""Theme 2, references: the added mass of the body, against Pinocchio, Munk's speed, and MuJoCo as a baseline."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

from evidence.references.mechanism import joint_torques
from evidence.scenarios import BARE, TWIST, WATER_OF_BODY, any_state, sized
from evidence.verification.claims import Claim, Section, rounded
from evidence.verification.mechanics import without_smoothing
from manta_sim_ros.dynamics import MONOLITHIC, FloatArray, Parameters, Simulator, State

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FRESHWATER = Path(__file__).parents[2] / 'config' / 'freshwater.yaml'
UNDAMPED = {'angular_damping': (0.0, 0.0, 0.0), 'linear_damping': (0.0,) * 6, 'quadratic_damping': (0.0,) * 6}
PUSH = np.array([3.0, -2.0, 4.0, 0.5, -0.4, 0.3])  # [N, N m], on the body
SMALL = 1e-6  # [rad/s], first pitch rate
SHORTEST = 1e-7  # [s], a step that changes nothing much
FORCE = 10.0  # [N], along the thinnest axis of the plate


def _error_against_pinocchio(seed: int) -> float:
    """Return the relative error of the body's acceleration in a random state without drag, rods at rest."""
    import pinocchio

    from evidence.references.pinocchio_tree import swimmer_tree

    parameters = without_smoothing(sized(
        4, 2, water={'density': 0.0}, fin=TWIST, solver={'coupling': MONOLITHIC, 'time_step': 1e-5},
        body={'added_mass': WATER_OF_BODY['added_mass'], 'gravity': 0.0, 'angular_damping': (0.0, 0.0, 0.0)}))
    state = Simulator(parameters, state=any_state(parameters, seed)).advance(1e-5, body_wrench=PUSH)
    tree = swimmer_tree(parameters)
    data = tree.createData()
    q = np.concatenate([state.position, state.orientation, state.joint_angles.ravel()])
    v = np.concatenate([state.twist, state.joint_rates.ravel()])
    inertia = pinocchio.crba(tree, data, q)
    inertia = np.triu(inertia) + np.triu(inertia, 1).T
    added_mass = np.array(parameters.body.added_mass)
    inertia[range(6), range(6)] += added_mass
    impulse, (velocity, omega) = added_mass * state.twist, np.split(state.twist, 2)
    coriolis = np.concatenate([
        np.cross(omega, impulse[:3]), np.cross(velocity, impulse[:3]) + np.cross(omega, impulse[3:])])
    width = parameters.rods.support_length / parameters.fin.chains
    torques = [joint_torques(parameters, *joints).ravel() * width
               for joints in zip(state.joint_angles, state.joint_rates, strict=True)]
    forces = np.concatenate([PUSH - coriolis, *torques]) - pinocchio.nonLinearEffects(tree, data, q, v)
    expected = np.linalg.solve(inertia, forces)[:6]
    return float(np.abs(state.acceleration - expected).max() / np.abs(expected).max())


def bare_body(time_step: float = 2e-3) -> Parameters:
    """Return the body of config/freshwater.yaml without drag and damping; it does not feel its fins."""
    return Parameters.from_yaml(FRESHWATER).replace(
        body=UNDAMPED, solver={'time_step': time_step}, **BARE).replace(water={'added_mass_coefficient': 0.0})


def munk_speed(parameters: Parameters) -> float:
    """Return U_c [m/s], from which the Munk moment of a small pitch is larger than the righting moment (derived)."""
    body = parameters.body
    along, _, across, *_ = body.added_mass
    righting = body.mass * body.gravity * body.buoyancy_center[2]
    return math.sqrt(righting * (body.mass + across) / ((across - along) * (body.mass + along)))


def _pitch_rate(parameters: Parameters, speed: float, duration: float) -> float:
    """Return the pitch rate after `duration` [s] over a small first one, at a forward speed [m/s]."""
    start = dataclasses.replace(State.at_rest(parameters), twist=[speed, 0.0, 0.0, 0.0, SMALL, 0.0])
    return float(Simulator(parameters, state=start).advance(duration).twist[4] / SMALL)


def added_mass_of_the_body(quick: bool = False) -> Section:
    """Compare accelerations with Pinocchio's, and the onset of the instability in pitch with Munk's."""
    states = 3 if quick else 20
    error = max(_error_against_pinocchio(seed) for seed in range(states))
    parameters = bare_body()
    body, expected = parameters.body, munk_speed(parameters)
    measured = float(brentq(
        lambda speed: _pitch_rate(parameters, speed, 4.0) - 1.0, 0.9 * expected, 1.1 * expected, xtol=1e-9))
    claims = (
        Claim("error of the body's acceleration with added mass in random states",
              "Pinocchio's tree with M_A and Fossen's C_A", error, 3e-13,
              'rounding times the condition of the tree; measured with a margin of 20'),
        Claim('error of the speed from which the bare body is unstable in pitch', "Munk's moment, derived",
              abs(measured / expected - 1.0), 1e-9, 'the mass of the fins that are left; measured with a margin of 8'),
    )

    def draw(figure: Figure) -> None:
        axes, duration = figure.subplots(), 0.5
        speeds = np.linspace(0.0, 1.4 * expected, 200)
        inertia, righting = body.inertia[1] + body.added_mass[4], body.mass * body.gravity * body.buoyancy_center[2]
        axes.plot(speeds, righting / inertia * ((speeds / expected) ** 2 - 1.0), 'k-', linewidth=0.9, label='derived')
        chosen = speeds[::20]
        ratios = np.array([_pitch_rate(parameters, speed, duration) for speed in chosen], dtype=complex)
        axes.plot(chosen, (np.arccosh(ratios) ** 2).real / duration**2, 'o', label='simulated')
        axes.axhline(0.0, color='0.6', linewidth=0.6)
        axes.axvline(expected, color='0.3', linestyle=':', label=f'$U_c$ = {expected:.4f} m/s')
        axes.set(xlabel='forward speed [m/s]', ylabel='square of the growth rate [1/s$^2$]')
        axes.legend()

    return Section('The added mass of the body', f"""
`body.added_mass` is not part of the paper. It stands on the left-hand side of (36), so that it may exceed the mass of
the body. In {states} random states of a moving robot in water without drag, the acceleration of the body is compared
with that of Pinocchio's tree: the added mass is added to its mass matrix, and the Coriolis terms are Fossen's. A body
that moves forward is turned across its path by the Munk moment, and upright by its buoyancy. The added mass of
`config/freshwater.yaml`, without fins and drag, is unstable in pitch above U_c = sqrt(m g r_b (m + A_z) / ((A_z - A_x)
(m + A_x))) = {rounded(expected, 4)} m/s. This speed is found from the sign of the growth of a small pitch rate. The
values of the added mass are verified below, in "Fresh water with its true density".
""", claims, draw, 'Square of the growth rate of a small pitch of the bare body; negative values are oscillations.')


def _mujoco_ellipsoid(half_axes: tuple[float, float, float], mass: float, inertia: tuple[float, ...]) -> Any:
    """Return MuJoCo's model of a free ellipsoid in a fluid that has its added mass, and neither drag nor lift."""
    import mujoco

    axes, moments = (' '.join(map(repr, map(float, values))) for values in (half_axes, inertia))
    return mujoco.MjModel.from_xml_string(f"""
<mujoco><option density="1000" viscosity="0" gravity="0 0 0" timestep="0.005" integrator="RK4"/><worldbody><body>
<freejoint/><inertial pos="0 0 0" mass="{mass!r}" diaginertia="{moments}"/>
<geom type="ellipsoid" size="{axes}" fluidshape="ellipsoid" fluidcoef="0 0 0 0 0"/></body></worldbody></mujoco>""")


def _pushed(model: Any) -> FloatArray:
    """Return times [s], velocities [m/s] and accelerations [m/s^2] (3, T) of MuJoCo's ellipsoid under `FORCE`."""
    import mujoco

    data = mujoco.MjData(model)
    data.xfrc_applied[1, 2] = FORCE
    samples = []
    for _ in range(101):
        mujoco.mj_forward(model, data)
        samples.append((data.time, data.qvel[2], data.qacc[2]))
        mujoco.mj_step(model, data)
    return np.array(samples).T


def _coriolis_error(model: Any, added_mass: FloatArray, twist: FloatArray) -> float:
    """Return the relative error of the forces of the added mass on the steadily moving ellipsoid, against MuJoCo's."""
    import mujoco

    parameters = bare_body(SHORTEST).replace(body={'added_mass': tuple(added_mass), 'gravity': 0.0})
    inertia = np.array([parameters.body.mass] * 3 + list(parameters.body.inertia))
    state = Simulator(parameters, state=dataclasses.replace(State.at_rest(parameters), twist=twist)).advance(SHORTEST)
    data = mujoco.MjData(model)
    data.qvel[:] = state.twist  # it has hardly turned
    mujoco.mj_forward(model, data)
    velocity, omega = np.split(state.twist, 2)
    bias = np.concatenate([np.cross(omega, inertia[:3] * velocity), np.cross(omega, inertia[3:] * omega)])
    forces = (inertia + added_mass) * state.acceleration + bias
    return float(np.abs(forces - data.qfrc_fluid).max() / np.abs(data.qfrc_fluid).max())


def plate_from_rest(quick: bool = False) -> Section:
    """Push a plate through the water from rest: here and in MuJoCo."""
    from evidence.verification.fresh_water import HALF_AXES, ellipsoid_added_mass

    parameters = bare_body(5e-3)
    body = parameters.body
    along = body.mass + body.added_mass[2]
    simulator, ours = Simulator(parameters), [(0.0, 0.0)]
    push = np.array([0.0, 0.0, FORCE, 0.0, 0.0, 0.0])
    for _ in range(100):
        state = simulator.advance(5e-3, body_wrench=push)
        ours.append((state.time, state.twist[2]))
    time, velocity = np.array(ours).T
    model = _mujoco_ellipsoid(HALF_AXES, body.mass, body.inertia)
    theirs, random = _pushed(model), np.random.default_rng(1)
    coriolis = max(_coriolis_error(model, ellipsoid_added_mass(HALF_AXES), random.uniform(-1.0, 1.0, 6))
                   for _ in range(5))
    claims = (
        Claim('error of the velocity of a plate that a force accelerates from rest', 'F t / (m + A)',
              float(np.abs(velocity / (FORCE / along) - time).max() / time[-1]), 5e-10,
              'the mass of the fins that are left; measured with a margin of 10'),
        Claim('error of the forces of the added mass that depend on velocities', "MuJoCo's ellipsoid in a fluid",
              coriolis, 3e-6, 'the digits of its integrals; measured with a margin of 4'),
        Claim("error of the first acceleration of MuJoCo's plate", 'F / m, as without water',
              float(abs(theirs[2, 0] / (FORCE / body.mass) - 1.0)), 1e-12, 'rounding'),
        Claim("first acceleration of MuJoCo's plate over that with its added mass", 'F / (m + A)',
              float(theirs[2, 0] / (FORCE / along)), (along / body.mass - 0.01, along / body.mass + 0.01),
              'derived: (m + A) / m, since its added mass has no part in the inertia'),
    )

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.plot(time, FORCE / body.mass * time, color='0.6', label='F t / m')
        axes.plot(time, FORCE / along * time, 'k-', label='F t / (m + A)')
        axes.plot(*theirs[:2, ::5], 's', label='MuJoCo, ellipsoid in a fluid')
        axes.plot(time[::5], velocity[::5], 'o', label='this simulator')
        axes.set(xlabel='time [s]', ylabel='velocity [m/s]')
        axes.legend()

    return Section('A plate that is accelerated from rest', f"""
A force of {rounded(FORCE)} N acts along the thinnest axis of the body of `config/freshwater.yaml`, an ellipsoid of
{rounded(body.mass)} kg with an added mass of {rounded(body.added_mass[2], 3)} kg. Without drag it must accelerate with
F / (m + A). The same ellipsoid in MuJoCo, whose fluid model has an added mass, accelerates with F / m, which is
{rounded(along / body.mass)} times as much. Its fluid model computes the forces of the added mass from the velocities
only, and not from the acceleration (google-deepmind/mujoco, issue 3452). So it has the Munk moment, but not the inertia
of the water. In random motions, those forces that depend on velocities agree with the simulator's.
""", claims, draw, 'Velocity of a plate that a steady force accelerates from rest, without drag.')


CHECKS = added_mass_of_the_body, plate_from_rest
