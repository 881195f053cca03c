"""The coupled dynamics of the robotic manta, free of ROS."""

from manta_sim_ros.dynamics.gait import FinCommand
from manta_sim_ros.dynamics.load import fin_loads
from manta_sim_ros.dynamics.parameters import Parameters
from manta_sim_ros.dynamics.simulator import DivergenceError, Simulator, fin_dynamics
from manta_sim_ros.dynamics.stability import StabilityWarning, largest_stable_step
from manta_sim_ros.dynamics.state import State
from manta_sim_ros.dynamics.surface import fin_surfaces

__all__ = [
    'DivergenceError', 'FinCommand', 'Parameters', 'Simulator', 'StabilityWarning', 'State', 'fin_dynamics',
    'fin_loads', 'fin_surfaces', 'largest_stable_step',
]
