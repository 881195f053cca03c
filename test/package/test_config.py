"""config/manta.yaml is the defaults of the code, written out: of the model and of the node."""

import dataclasses
from pathlib import Path

import yaml

from manta_sim_ros.dynamics import Parameters
from manta_sim_ros.nodes.interface import TOPICS
from manta_sim_ros.nodes.settings import NodeParameters, Settings

CONFIG = Path(__file__).parents[2] / 'config' / 'manta.yaml'


def test_the_file_is_read_as_the_defaults():
    assert Parameters.from_yaml(CONFIG) == Parameters()


def test_the_file_holds_every_name_and_default_and_no_other():
    def written(value):
        if isinstance(value, dict):
            return {name: written(part) for name, part in value.items()}
        return list(value) if isinstance(value, tuple) else value

    content = yaml.safe_load(CONFIG.read_text(encoding='utf-8'))
    assert list(content) == ['/**'] and list(content['/**']) == ['ros__parameters']
    listed = content['/**']['ros__parameters']
    settings = dataclasses.asdict(Settings())
    desired = written({**settings.pop('model'), **settings.pop('node'), **settings})
    assert listed == desired

    def kinds(value):
        if isinstance(value, dict):
            return {name: kinds(part) for name, part in value.items()}
        return [kinds(part) for part in value] if isinstance(value, list) else type(value)

    assert kinds(listed) == kinds(desired)  # ROS 2 takes no whole number for one with a decimal point


def test_the_freshwater_file_has_true_densities_added_mass_and_twist_stiffness():
    freshwater = Parameters.from_yaml(CONFIG.parent / 'freshwater.yaml')
    assert freshwater.water.density == freshwater.water.added_mass_density == freshwater.fin.density == 1000.0
    assert freshwater.water.added_mass_coefficient > 0.0 and freshwater.solver.coupling == 'monolithic'
    # all else is the defaults': no geometry and no bending stiffness was changed
    changed = {
        f'{group}.{name}' for group, values in dataclasses.asdict(freshwater).items() for name, value in values.items()
        if value != getattr(getattr(Parameters(), group), name)}
    assert changed == {
        'water.density', 'water.added_mass_coefficient', 'body.drag_coefficient', 'body.added_mass',
        'body.quadratic_damping', 'fin.chains', 'fin.drag_coefficient', 'fin.shear_modulus', 'solver.time_step',
        'solver.coupling'}


def test_the_filter_fuses_topics_of_the_robot_in_its_frames():
    content = yaml.safe_load((CONFIG.parent / 'robot_localization.yaml').read_text(encoding='utf-8'))
    values, own = content['/**']['ros__parameters'], NodeParameters()
    assert (values['odom_frame'], values['base_link_frame']) == (own.odom_frame, own.base_frame)
    assert values['world_frame'] == values['odom_frame'] and values['publish_tf'] is True
    assert TOPICS[values['imu0']].type == 'sensor_msgs/msg/Imu'
    assert TOPICS[values['twist0']].type == 'geometry_msgs/msg/TwistWithCovarianceStamped'
    assert f"'{values['pose0']}'" in (CONFIG.parents[1] / 'examples' / 'depth_from_pressure.py').read_text()
    fused = {name: [index for index, value in enumerate(values[f'{name}_config']) if value is True]
             for name in ('imu0', 'twist0', 'pose0') if len(values[f'{name}_config']) == 15}
    assert fused == {'imu0': [3, 4, 5, 9, 10, 11], 'twist0': [6, 7, 8], 'pose0': [2]}
