"""The whole robot as a MuJoCo model in MuJoCo's water: a baseline for the step that the benchmark measures."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np

from manta_sim_ros.dynamics import FloatArray, Parameters

WATER_DENSITY = 1000.0  # kg/m^3, fresh water; `water.density` is effective and belongs to the model's drag coefficients
WATER_VISCOSITY = 1.0e-3  # Pa s
BODY_HALF_AXES = '0.25 0.15 0.08'  # m, of an ellipsoid like a manta for the body's drag; its mass is set separately
SLIMNESS = 1.0e-6  # inertia of a thin rod about its axis over that across it; MuJoCo needs a positive one


def swimmer_model(parameters: Parameters, time_step: float) -> mujoco.MjModel:
    """The tree of `pinocchio_tree.swimmer_tree`, with springs, dampers and water: 6 + 2 n m degrees of freedom, RK4.

    The free body has its frame at its center of mass. The left and the right fin stand on supports that are fixed where
    level rods hold them. The hinges have the model's stiffness, linearized, and its damping: EI ds/dl [N m/rad] and
    c ds [N m s/rad]. `time_step` is in s. The water acts on the ellipsoid of each link. (MuJoCo's other fluid model
    costs the same, but it acts on the box that has the link's inertia, and that of a thin rod has no area.) There is no
    gravity, and there are no contacts.
    """
    fin, rods = parameters.fin, parameters.rods
    root = ElementTree.Element('mujoco', model='manta')
    ElementTree.SubElement(root, 'compiler', angle='radian')
    option = ElementTree.SubElement(root, 'option', timestep=repr(time_step), integrator='RK4', gravity='0 0 0',
                                    density=repr(WATER_DENSITY), viscosity=repr(WATER_VISCOSITY))
    ElementTree.SubElement(option, 'flag', contact='disable')
    default = ElementTree.SubElement(root, 'default')
    ElementTree.SubElement(default, 'geom', type='ellipsoid', contype='0', conaffinity='0', fluidshape='ellipsoid')
    width, length = rods.support_length / fin.chains, fin.span / fin.links
    mass = fin.density * fin.thickness * length * width
    across = mass * length**2 / 12.0
    stiffness = fin.youngs_modulus * fin.thickness**3 / 12.0 / length * width
    ElementTree.SubElement(default, 'joint', type='hinge', stiffness=repr(stiffness),
                           damping=repr(fin.joint_damping * width))

    world = ElementTree.SubElement(root, 'worldbody')
    body = ElementTree.SubElement(world, 'body', name='body')
    ElementTree.SubElement(body, 'freejoint')
    ElementTree.SubElement(body, 'inertial', pos='0 0 0', mass=repr(parameters.body.mass),
                           diaginertia=_vector(parameters.body.inertia))
    ElementTree.SubElement(body, 'geom', size=BODY_HALF_AXES)
    for side, outward in enumerate((1.0, -1.0)):
        rotation, position = _flat_support(parameters, outward)
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, rotation.ravel())
        for k in range(fin.chains):
            parent, turn = body, quaternion
            at = position + rotation[:, 0] * (rods.support_length - (k + 0.5) * width)
            for j in range(fin.links):
                parent = ElementTree.SubElement(parent, 'body', name=f'link_{side}_{k}_{j}', pos=_vector(at),
                                                quat=_vector(turn))
                middle = _vector((0.0, 0.5 * outward * length, 0.0))
                ElementTree.SubElement(parent, 'joint', axis=_vector((outward, 0.0, 0.0)))
                ElementTree.SubElement(parent, 'inertial', pos=middle, mass=repr(mass),
                                       diaginertia=_vector((across, SLIMNESS * across, across)))
                ElementTree.SubElement(parent, 'geom', pos=middle,
                                       size=_vector((0.5 * width, 0.5 * length, 0.5 * fin.thickness)))
                at, turn = np.array([0.0, outward * length, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding='unicode'))


def _flat_support(parameters: Parameters, outward: float) -> tuple[FloatArray, FloatArray]:
    """Rotation (3, 3) and position (3,) [m] of F_0 in F_b with both rods level: a rotation about z alone."""
    rods = parameters.rods
    sine = outward * (rods.front_radius - rods.rear_radius) / rods.support_length
    cosine = np.sqrt(1.0 - sine**2)
    rotation = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    x, y, z = rods.rear_motor_position
    return rotation, np.array([x, outward * (y + rods.rear_radius), z])


def _vector(values: tuple[float, ...] | FloatArray) -> str:
    return ' '.join(repr(float(value)) for value in values)
