"""The node `manta_mpc_follower`: it follows a path as `path_follower` does, with a plan of the next gaits."""

from __future__ import annotations

from collections.abc import Callable

import rclpy

from manta_sim_ros.control.averaged_model import MODELS, read_model
from manta_sim_ros.control.mpc import MpcFollower, check_gaits
from manta_sim_ros.control.mpc_settings import MpcSettings
from manta_sim_ros.control.polyline import Polyline
from manta_sim_ros.dynamics import Parameters
from manta_sim_ros.nodes.parameters import ParameterNode, declare_group, declare_value
from manta_sim_ros.nodes.path_follower import Controller, PathFollowerNode
from manta_sim_ros.nodes.process import run_node


def model_predictive(node: ParameterNode, robot: Parameters) -> Callable[[Polyline], Controller]:
    """Declare the parameters of the model-predictive follower, and return what makes it.

    Raises
    ------
    ValueError
        A parameter is invalid, or the rods of the robot cannot follow it; names the value and the bound.

    """
    settings = declare_group(node, MpcSettings)
    file = declare_value(node, 'model', 'freshwater',
                         f'averaged model of the robot: {", ".join(MODELS)}, or a file that averaged_model printed')
    model = read_model(MODELS.get(file, file))
    check_gaits(settings, model, robot)
    return lambda path: MpcFollower(path, settings, model, robot, warn=node.get_logger().warning)


def node() -> PathFollowerNode:
    """Return the node."""
    return PathFollowerNode('manta_mpc_follower', model_predictive)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    run_node(node, lambda node: None, rclpy.spin_until_future_complete, args)
