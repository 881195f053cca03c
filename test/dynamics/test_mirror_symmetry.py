"""The right fin is the left fin in a mirror, to the last bit."""

import dataclasses

import numpy as np
import pytest

from evidence.scenarios import (
    MIRROR,
    SOFT_TWIST,
    SWIM,
    TURN,
    WATER_OF_BODY,
    any_moment,
    assert_same_bits,
    mirrored,
    sized,
    twisting,
)
from manta_sim_ros.dynamics import FinCommand, Parameters, Simulator, State, fin_dynamics


@pytest.mark.parametrize('seed', range(5))
def test_the_right_fin_is_the_left_one_mirrored_to_the_last_bit(seed):
    parameters = twisting(sized(17, 3)) if seed % 2 else sized(17, 3)
    rods, angles, rates, twist, acceleration = any_moment(parameters, seed)
    left = fin_dynamics(parameters, 0, rods, angles, rates, twist, acceleration)
    right = fin_dynamics(parameters, 1, rods, angles, rates, MIRROR * twist, MIRROR * acceleration)
    np.testing.assert_array_equal(right[0], left[0])
    np.testing.assert_array_equal(right[1], MIRROR * left[1])


@pytest.mark.parametrize(('gait', 'groups'), [
    (SWIM, {}),
    (TURN, {}),
    (FinCommand(amplitude=0.5, frequency=1.1, phase=-0.4, front_bias=0.2), {'rods': {'command_time_constant': 0.0}}),
    (SWIM, {'water': {'current': (0.3, 0.0, -0.2)}}),
])
def test_a_symmetric_gait_never_leaves_the_plane_of_symmetry(gait, groups):
    simulator = Simulator(Parameters().replace(**groups))
    simulator.command(left=gait, right=gait)
    for _ in range(8):
        state = simulator.advance(1.0)
        assert np.linalg.norm(state.twist[[0, 2, 4]]) > 1e-3  # it moves
        assert state.position[1] == 0.0
        np.testing.assert_array_equal(state.orientation[[0, 2]], 0.0)  # neither roll nor yaw
        np.testing.assert_array_equal(state.twist[[1, 3, 5]], 0.0)
        np.testing.assert_array_equal(state.acceleration[[1, 3, 5]], 0.0)
        np.testing.assert_array_equal(state.wrench[[1, 3, 5]], 0.0)
        np.testing.assert_array_equal(state.joint_angles[0], state.joint_angles[1])


@pytest.mark.parametrize('groups', [{}, {'fin': SOFT_TWIST, 'body': WATER_OF_BODY}], ids=['paper', 'beyond the paper'])
def test_exchanged_commands_make_the_mirrored_motion_to_the_last_bit(groups):
    parameters = sized(17, 2, water={'current': (0.2, 0.1, -0.1)}, **groups)
    start = dataclasses.replace(
        State.at_rest(parameters), position=(1.0, 2.0, 3.0), orientation=np.array([1.0, -2.0, 3.0, 4.0]) / 30**0.5,
        twist=(0.1, 0.2, -0.1, 0.3, -0.2, 0.1))
    one = Simulator(parameters, state=start)
    other = Simulator(parameters.replace(water={'current': (0.2, -0.1, -0.1)}), state=mirrored(start))
    for left, right in ((SWIM, TURN), (TURN, TURN), (SWIM, SWIM)):
        one.command(left=left, right=right)
        other.command(left=right, right=left)
        for _ in range(4):
            seen, reference = mirrored(other.advance(0.5)), one.advance(0.5)
            assert abs(reference.position[1]) > 1e-3
            assert_same_bits(dataclasses.replace(reference), seen)
