"""The coupled dynamics of the robotic manta, free of ROS: every public name has its one path here."""

from manta_sim_ros.dynamics.batch import simulate_batch
from manta_sim_ros.dynamics.command import REST, SIDES, FinCommand
from manta_sim_ros.dynamics.load import fin_loads, immersed_shares
from manta_sim_ros.dynamics.noise import gaussian_noise, random_walk
from manta_sim_ros.dynamics.parameter_file import read_sections, values_for
from manta_sim_ros.dynamics.parameters import MONOLITHIC, SEQUENTIAL, Parameters
from manta_sim_ros.dynamics.quantity import (
    LARGEST_SEED,
    FloatArray,
    ParameterGroup,
    Quantity,
    Vector,
    cut,
    quantity,
    shown,
    shown_name,
    shown_names,
)
from manta_sim_ros.dynamics.simulator import DivergenceError, Simulator, compile_kernels, fin_dynamics
from manta_sim_ros.dynamics.stability import (
    ModelWarning,
    StabilityWarning,
    body_warning,
    largest_stable_step,
    step_warning,
    turn_warning,
)
from manta_sim_ros.dynamics.state import State
from manta_sim_ros.dynamics.surface import fin_surfaces, rod_rates, support_angles, support_rates

__all__ = [
    'LARGEST_SEED', 'MONOLITHIC', 'REST', 'SEQUENTIAL', 'SIDES', 'DivergenceError', 'FinCommand', 'FloatArray',
    'ModelWarning', 'ParameterGroup', 'Parameters', 'Quantity', 'Simulator', 'StabilityWarning', 'State', 'Vector',
    'body_warning', 'compile_kernels', 'cut', 'fin_dynamics', 'fin_loads', 'fin_surfaces', 'gaussian_noise',
    'immersed_shares', 'largest_stable_step', 'quantity', 'random_walk', 'read_sections', 'rod_rates', 'shown',
    'shown_name', 'shown_names', 'simulate_batch', 'step_warning', 'support_angles', 'support_rates', 'turn_warning',
    'values_for',
]
