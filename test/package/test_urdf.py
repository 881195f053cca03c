"""urdf/manta.urdf.xacro is the robot of the model: its forward kinematics, by Pinocchio, and its numbers."""

import dataclasses
import math
import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import rclpy
import xacro
import yaml

from evidence.references.mechanism import OUTWARD
from evidence.scenarios import SWIM, TURN
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, fin_surfaces, support_angles
from manta_sim_ros.dynamics._kernels.layout import stations
from manta_sim_ros.dynamics.command import LARGEST_ROD_ANGLE
from manta_sim_ros.nodes.interface import TOPICS
from manta_sim_ros.nodes.messages import ROD_NAMES

ROOT = Path(__file__).parents[2]
XACRO = ROOT / 'urdf' / 'manta.urdf.xacro'
SIDES = ('left', 'right')
RODS = [f'{side}_{end}_rod' for side in SIDES for end in ('front', 'rear')]
SUPPORTS = [f'{side}_support_{angle}' for side in SIDES for angle in ('yaw', 'pitch')]
ROUNDING = 1e-14  # [m] of positions below 1 m
OTHER_SIZES = Parameters().replace(
    body={'mass': 31.0, 'inertia': (1.5, 2.5, 3.5)},
    rods={'front_radius': 0.3, 'rear_radius': 0.2, 'support_length': 0.4, 'rear_motor_position': (-0.2, 0.25, 0.03)})


def urdf(path=XACRO, **arguments):
    return xacro.process_file(str(path), mappings=arguments).toxml()


def written(parameters, folder):
    """Return the path of a parameter file with the groups of `parameters` that the robot's shape and mass are in."""
    groups = {name: {key: list(value) if isinstance(value, tuple) else value
                     for key, value in dataclasses.asdict(getattr(parameters, name)).items()}
              for name in ('body', 'rods')}
    path = folder / 'sizes.yaml'
    path.write_text(yaml.safe_dump({'/**': {'ros__parameters': groups}}), encoding='utf-8')
    return str(path)


def model_of(text):
    """Return Pinocchio's model: a free-flyer at the body frame, the mimic joint following its rod."""
    pinocchio = pytest.importorskip('pinocchio')
    return pinocchio.buildModelFromXML(text, pinocchio.JointModelFreeFlyer(), True)


def placements(model, parameters, rod_angles):
    """Return {link: placement in F_b} with the rods at `rod_angles` (2, 2) [fin, front or rear] [rad]."""
    import pinocchio

    q = pinocchio.neutral(model)
    for side, rods, theta, beta in zip(SIDES, rod_angles, *support_angles(parameters, rod_angles)):
        angles = {'front_rod': rods[0], 'rear_rod': rods[1], 'support_yaw': theta, 'support_pitch': beta}
        for joint, angle in angles.items():
            q[model.joints[model.getJointId(f'{side}_{joint}')].idx_q] = angle
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, q)
    return {frame.name: placement for frame, placement in zip(model.frames, data.oMf)
            if frame.type == pinocchio.FrameType.BODY}


@pytest.fixture(scope='module', params=['default', 'other'])
def sizes(request, tmp_path_factory):
    """Parameters, and the URDF of their file."""
    if request.param == 'default':
        return Parameters(), urdf()
    return OTHER_SIZES, urdf(config=written(OTHER_SIZES, tmp_path_factory.mktemp('config')))


@pytest.fixture(scope='module')
def swimming(sizes):
    """Rod angles (2, 2) [rad] of some moments of a robot that turns: the fins differ, and the biases are not zero."""
    simulator = Simulator(sizes[0].replace(fin={'chains': 4}))
    simulator.command(left=SWIM, right=TURN)
    return [simulator.advance(0.3).rod_angles for _ in range(6)]


def test_the_supports_are_where_the_fins_of_the_model_begin_while_it_swims(sizes, swimming):
    parameters, text = sizes
    model, fin, length = model_of(text), parameters.fin, parameters.rods.support_length
    assert np.ptp(swimming, axis=0).min() > 0.1  # every rod moves
    for rod_angles in swimming:
        links = placements(model, parameters, rod_angles)
        surfaces = fin_surfaces(parameters, rod_angles, np.zeros((2, fin.chains, fin.links)))
        for side, name in enumerate(SIDES):
            support = links[f'{name}_support_link']
            for along, chain in zip(stations(fin.chains, length), surfaces[side]):
                for out, node in (0.0, chain[0]), (OUTWARD[side] * fin.span, chain[-1]):
                    np.testing.assert_allclose(
                        support.act(np.array([along, out, 0.0])), node, rtol=0.0, atol=ROUNDING)


def test_the_rods_hold_the_supports_at_both_ends(sizes, swimming):
    parameters, text = sizes
    model, rods = model_of(text), parameters.rods
    for rod_angles in [np.zeros((2, 2)), *swimming]:
        links = placements(model, parameters, rod_angles)
        for side, name in enumerate(SIDES):
            support = links[f'{name}_support_link']
            rear, front = (
                links[f'{name}_{end}_rod_link'].act(np.array([0.0, OUTWARD[side] * radius, 0.0]))
                for end, radius in (('rear', rods.rear_radius), ('front', rods.front_radius)))
            np.testing.assert_allclose(support.translation, rear, rtol=0.0, atol=ROUNDING)
            held = support.act(np.array([rods.support_length, 0.0, 0.0]))  # slides along x on the front rod
            np.testing.assert_allclose(held[1:], front[1:], rtol=0.0, atol=ROUNDING)
            if not rod_angles.any():
                np.testing.assert_allclose(held, front, rtol=0.0, atol=ROUNDING)


def test_mass_and_inertia_are_those_of_the_body(sizes):
    parameters, text = sizes
    body = model_of(text).inertias[1]
    assert body.mass == parameters.body.mass
    np.testing.assert_array_equal(body.lever, np.zeros(3))
    np.testing.assert_allclose(body.inertia, np.diag(parameters.body.inertia), rtol=1e-15)


def test_every_joint_of_joint_states_is_one_with_limits_that_hold_every_command():
    bounds = {name: about.high for name, about in FinCommand.quantities().items()}
    rod = bounds['amplitude'] + max(bounds['front_bias'], bounds['rear_bias'])
    joints = {joint.get('name'): joint for joint in ElementTree.fromstring(urdf()).iter('joint')}
    for name, angle in [*((name, rod) for name in RODS), *((name, math.pi / 2.0) for name in SUPPORTS)]:
        limit = joints[name].find('limit')
        assert joints[name].get('type') == 'revolute'
        assert -float(limit.get('lower')) == float(limit.get('upper')) == pytest.approx(angle, rel=1e-15)
        assert float(limit.get('velocity')) == pytest.approx(2.0 * math.pi * bounds['frequency'] * bounds['amplitude'])
    moving = {name for name, joint in joints.items() if joint.get('type') != 'fixed' and joint.find('mimic') is None}
    assert moving == {*RODS, *SUPPORTS}  # robot_state_publisher would wait in vain for any other


def test_the_root_is_the_body_frame_without_inertia():
    tree = ElementTree.fromstring(urdf())
    links = {link.get('name'): link for link in tree.iter('link')}
    root, = set(links) - {joint.find('child').get('link') for joint in tree.iter('joint')}
    assert root == 'base_link'
    assert links[root].find('inertial') is None  # KDL, which robot_state_publisher uses, takes none there


@pytest.mark.parametrize(('base_frame', 'prefix'), [('manta_1/base_link', 'manta_1/'), ('hull', '')])
def test_a_base_frame_names_the_root_and_goes_before_all_other_links(base_frame, prefix, tmp_path):
    config = tmp_path / 'frames.yaml'
    config.write_text(f'/**: {{ros__parameters: {{base_frame: {base_frame}}}}}', encoding='utf-8')
    desired = {base_frame} | {
        prefix + link.get('name') for link in ElementTree.fromstring(urdf()).iter('link')
        if link.get('name') != 'base_link'}
    for text in (urdf(base_frame=base_frame), urdf(config=str(config))):
        assert {link.get('name') for link in ElementTree.fromstring(text).iter('link')} == desired
    joints = {joint.get('name') for joint in ElementTree.fromstring(urdf(base_frame=base_frame)).iter('joint')}
    assert {*RODS, *SUPPORTS} <= joints  # as in joint_states of every robot


def test_the_default_config_is_found_from_any_working_directory_and_where_it_is_installed(tmp_path, monkeypatch):
    for folder in ('urdf', 'config'):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    config = tmp_path / 'config' / 'manta.yaml'
    config.write_text(config.read_text(encoding='utf-8').replace('mass: 20.0', 'mass: 2.1e1'), encoding='utf-8')
    monkeypatch.chdir('/')
    assert model_of(urdf(tmp_path / 'urdf' / XACRO.name)).inertias[1].mass == 21.0
    assert model_of(urdf()).inertias[1].mass == 20.0


def test_the_rods_are_a_system_of_ros2_control_that_the_node_and_the_controllers_know():
    folder = ROOT / 'config' / 'ros2_control'
    robot = ElementTree.fromstring(urdf(folder / 'manta.urdf.xacro', commands_topic='/a/rod_command'))
    (system,) = robot.iter('ros2_control')
    parameters = {parameter.get('name'): parameter.text for parameter in system.find('hardware').iter('param')}
    assert parameters['joint_commands_topic'] == '/a/rod_command'
    assert parameters['joint_states_topic'] == '/joint_states'
    assert {'rod_command', 'joint_states'} <= set(TOPICS)
    controlled = system.findall('joint')
    assert [joint.get('name') for joint in controlled] == RODS == ROD_NAMES
    joints = {joint.get('name') for joint in robot.findall('joint')}
    assert joints >= set(RODS)  # the ones of the robot, which the system moves
    for joint in controlled:
        values = {value.get('name'): float(value.text) for value in joint.find('command_interface').iter('param')}
        assert values == {  # without the first one, NaN is commanded until a controller is active
            'initial_value': 0.0, 'min': pytest.approx(-LARGEST_ROD_ANGLE), 'max': pytest.approx(LARGEST_ROD_ANGLE)}
    controllers = yaml.safe_load((folder / 'controllers.yaml').read_text(encoding='utf-8'))
    assert all(name.startswith('/**/') for name in controllers)  # in any namespace
    for name in ('rod_positions', 'rod_trajectory'):
        assert name in controllers['/**/controller_manager']['ros__parameters']
        assert controllers[f'/**/{name}']['ros__parameters']['joints'] == RODS


@pytest.mark.parametrize('folder', ['urdf', 'config/ros2_control'])
def test_a_command_line_of_ros_2_takes_the_robot_description(folder):
    """It is read as YAML, and must be a text there."""
    description = urdf(ROOT / folder / 'manta.urdf.xacro')
    context = rclpy.Context()
    rclpy.init(args=['--ros-args', '-p', f'robot_description:={description}'], context=context)
    node = rclpy.create_node('describing', context=context, automatically_declare_parameters_from_overrides=True)
    taken = node.get_parameter('robot_description').value
    node.destroy_node()
    context.shutdown()
    assert ElementTree.fromstring(taken).get('name') == 'manta'
