"""Reinforcement learning: the environment `manta_sim_ros/Swim-v0` of Gymnasium, free of ROS.

The import registers it; needs the extra `learn`. Every public name has its one path here.
"""

import gymnasium

from manta_sim_ros.learning.actions import Number, action_numbers
from manta_sim_ros.learning.environment import SwimEnv
from manta_sim_ros.learning.observations import OBSERVATION, mirrored
from manta_sim_ros.learning.settings import ROBOT, SwimSettings
from manta_sim_ros.learning.vector_environment import SwimVectorEnv

__all__ = [
    'ENVIRONMENT', 'OBSERVATION', 'ROBOT', 'Number', 'SwimEnv', 'SwimSettings', 'SwimVectorEnv', 'action_numbers',
    'mirrored',
]

ENVIRONMENT = 'manta_sim_ros/Swim-v0'
"""Id of the environment."""

gymnasium.register(
    ENVIRONMENT, entry_point='manta_sim_ros.learning:SwimEnv',
    vector_entry_point='manta_sim_ros.learning:SwimVectorEnv', max_episode_steps=300)
