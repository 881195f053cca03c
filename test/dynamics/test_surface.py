"""Where the fins are: against Pinocchio's forward kinematics, and by hand."""

import numpy as np
import pytest

from evidence.references.mechanism import support_pose
from evidence.scenarios import sized
from manta_sim_ros.dynamics import Parameters, fin_surfaces

ROUNDING = 1e-14  # [m] of positions below 2 m; some ten roundings of 2e-16 each


def random_angles(parameters, seed, *times):
    """Rod angles (..., 2, 2) and joint angles (..., 2, n, m) [rad], larger than a robot has them."""
    random = np.random.default_rng(seed)
    joints = (*times, 2, parameters.fin.chains, parameters.fin.links)
    return random.uniform(-0.5, 0.5, (*times, 2, 2)), random.uniform(-1.0, 1.0, joints)


def tree_nodes(model, parameters, side, rod_angles, joint_angles):
    """Nodes (n, m + 1, 3) [m] of one fin in F_b, from the joints' and tips' placements in its Pinocchio tree."""
    import pinocchio

    rotation, position = support_pose(parameters, side, np.column_stack([rod_angles, np.zeros((2, 2))]))
    support = pinocchio.SE3ToXYZQUAT(pinocchio.SE3(rotation.value, position.value))
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, np.concatenate([support, joint_angles.ravel()]))
    chains, links = joint_angles.shape
    nodes = np.empty((chains, links + 1, 3))
    for k in range(chains):
        nodes[k, 0] = data.oMi[model.getJointId(f'joint_{side}_{k}_0')].translation
        for j in range(links):
            nodes[k, j + 1] = data.oMf[model.getFrameId(f'tip_{side}_{k}_{j}')].translation
    return nodes


@pytest.mark.parametrize('side', [0, 1])
@pytest.mark.parametrize(('chains', 'links'), [(2, 1), (7, 6), (30, 3)])
def test_nodes_are_where_the_forward_kinematics_of_pinocchio_has_them(side, chains, links, pinocchio_tree):
    parameters = sized(chains, links)
    rod_angles, joint_angles = random_angles(parameters, seed=100 * chains + links)
    expected = tree_nodes(
        pinocchio_tree.fin_tree(parameters, side), parameters, side, rod_angles[side], joint_angles[side])
    nodes = fin_surfaces(parameters, rod_angles, joint_angles)
    assert nodes.shape == (2, chains, links + 1, 3)
    np.testing.assert_allclose(nodes[side], expected, rtol=0.0, atol=ROUNDING)


def test_leading_axes_are_as_many_calls():
    parameters = sized(4, 3)
    rod_angles, joint_angles = random_angles(parameters, 1, 5, 2)
    nodes = fin_surfaces(parameters, rod_angles, joint_angles)
    assert nodes.shape == (5, 2, 2, 4, 4, 3)
    for time in np.ndindex(5, 2):
        np.testing.assert_array_equal(nodes[time], fin_surfaces(parameters, rod_angles[time], joint_angles[time]))


def test_fins_of_equal_angles_are_each_other_in_a_mirror():
    parameters = sized(4, 3)
    angles = [np.broadcast_to(part[:1], part.shape) for part in random_angles(parameters, 2)]
    left, right = fin_surfaces(parameters, *angles)
    np.testing.assert_array_equal(right, left * [1.0, -1.0, 1.0])


def test_level_rods_and_straight_joints_make_a_level_fin_ahead_of_the_rear_motor():
    parameters = sized(3, 2, rods={'front_radius': 0.2, 'rear_radius': 0.2, 'support_length': 0.3,
                                   'rear_motor_position': (-0.1, 0.3, 0.05)}, fin={'span': 0.4})
    left, right = fin_surfaces(parameters, np.zeros((2, 2)), np.zeros((2, 3, 2)))
    for k, x in enumerate([0.15, 0.05, -0.05]):  # the middle of each third of the support, the front one first
        for j, y in enumerate([0.5, 0.7, 0.9]):
            np.testing.assert_allclose(left[k, j], [x, y, 0.05], rtol=0.0, atol=ROUNDING)
            np.testing.assert_allclose(right[k, j], [x, -y, 0.05], rtol=0.0, atol=ROUNDING)


def test_rods_and_joints_turned_up_by_a_right_angle_stand_on_end():
    parameters = sized(2, 2, rods={'front_radius': 0.2, 'rear_radius': 0.2, 'support_length': 0.3,
                                   'rear_motor_position': (-0.1, 0.3, 0.0)}, fin={'span': 0.4})
    joint_angles = np.tile([np.pi / 2.0, -np.pi / 2.0], (2, 2, 1))  # up, then outward again
    left, right = fin_surfaces(parameters, np.full((2, 2), np.pi / 2.0), joint_angles)
    expected = [[x, y, z] for x in (0.125, -0.025) for y, z in ((0.3, 0.2), (0.3, 0.4), (0.5, 0.4))]
    np.testing.assert_allclose(left.reshape(6, 3), expected, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(right.reshape(6, 3), np.multiply(expected, [1.0, -1.0, 1.0]), rtol=0.0, atol=ROUNDING)


def test_the_longer_front_rod_toes_the_support_out_and_the_higher_pitches_it_up():
    parameters, joints = Parameters(), np.zeros((2, 30, 3))
    rods = parameters.rods
    level = fin_surfaces(parameters, np.zeros((2, 2)), joints)[0]
    toe = (rods.front_radius - rods.rear_radius) / rods.support_length
    ahead, outward = (level[0, 0] - level[-1, 0])[:2] / rods.support_length * 30 / 29
    np.testing.assert_allclose([ahead, outward], [np.sqrt(1.0 - toe**2), toe], rtol=1e-13)
    np.testing.assert_allclose(level[..., 2], 0.0, atol=ROUNDING)

    raised = fin_surfaces(parameters, np.array([[0.3, 0.0], [0.3, 0.0]]), joints)[0]
    pitch = rods.front_radius * np.sin(0.3) / rods.support_length
    assert (raised[0, 0] - raised[-1, 0])[2] / rods.support_length * 30 / 29 == pytest.approx(pitch, rel=1e-13)
    np.testing.assert_array_equal(raised[:, 0, 2], raised[:, -1, 2])  # straight chains stay level
