"""Start the simulator and, as the arguments say, the example controller, the robot's frames, RViz and a recording."""
from datetime import datetime
from importlib.util import find_spec
from os import environ
from pathlib import Path
from tempfile import NamedTemporaryFile

import yaml
from ament_index_python.packages import PackageNotFoundError, get_package_prefix, get_package_share_path
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueCoroutine, OpaqueFunction, Shutdown
from launch.logging import get_logger
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare
from launch_ros.utilities import make_namespace_absolute, prefix_namespace

from manta_sim_ros.dynamics import read_sections, values_for
from manta_sim_ros.nodes.interface import TOPICS
from manta_sim_ros.nodes.recording import run_when_recorded

BOOLEANS = ['true', 'false', 'True', 'False']
NEEDED = {
    'rviz': ['rviz2'],
    'robot_state_publisher': ['robot_state_publisher', 'xacro'],
    'record': ['ros2bag', 'rosbag2_storage_mcap'],
}
RECORDED = [*TOPICS, 'robot_description']
SEEDS = ['imu.seed', 'pressure.seed', 'velocity.seed', 'odom_noise.seed']


def generate_launch_description():
    share = FindPackageShare('manta_sim_ros')
    return LaunchDescription([
        DeclareLaunchArgument('namespace', default_value='', description='namespace of all nodes'),
        DeclareLaunchArgument('config', default_value=PathJoinSubstitution([share, 'config', 'manta.yaml']),
                              description='parameter file of the simulator'),
        DeclareLaunchArgument('gait', default_value='true', choices=BOOLEANS,
                              description='start gait_node, the example controller'),
        DeclareLaunchArgument('current', default_value='',
                              description='velocity of the water, such as [0, 0.1, 0] in m/s; empty: as in config'),
        DeclareLaunchArgument('initial_position', default_value='',
                              description='where it starts, such as [0, 3, -1] in m; empty: as in config'),
        DeclareLaunchArgument('initial_yaw', default_value='',
                              description='heading there in rad; empty: as in config'),
        DeclareLaunchArgument('sensor_seed', default_value='',
                              description='seed of the noise of its sensors; empty: as in config'),
        DeclareLaunchArgument('real_time_factor', default_value='',
                              description='simulated time over elapsed time; empty: as in config'),
        DeclareLaunchArgument('publish_clock', default_value='', choices=['', *BOOLEANS],
                              description='false: follow the /clock of another robot; empty: as in config'),
        DeclareLaunchArgument('odom_frame', default_value='', description='world frame; empty: as in config'),
        DeclareLaunchArgument('base_frame', default_value='',
                              description='body frame, such as manta_1/base_link; empty: as in config'),
        DeclareLaunchArgument('rviz', default_value='false', choices=BOOLEANS, description='start RViz'),
        DeclareLaunchArgument('rviz_config', default_value=PathJoinSubstitution([share, 'rviz', 'manta.rviz']),
                              description='what RViz shows'),
        DeclareLaunchArgument('robot_state_publisher', default_value=LaunchConfiguration('rviz'), choices=BOOLEANS,
                              description='publish robot_description and the frames of rods and supports'),
        DeclareLaunchArgument('record', default_value='false', choices=BOOLEANS,
                              description='record all topics of the robot to MCAP, stamped with simulated time'),
        DeclareLaunchArgument('bag', default_value='',
                              description='directory of the recording; empty: rosbag2_ with date, time and namespace'),
        OpaqueFunction(function=processes),
    ])


def processes(context):
    """Return all processes, or raise an error before any is started."""
    def value(name):
        return LaunchConfiguration(name).perform(context)

    def wanted(name):
        return value(name).lower() == 'true'

    config = Path(value('config')).expanduser().absolute()
    if not config.is_file():  # launch would warn and start the simulator without it
        raise RuntimeError(f'config is {str(config)!r}, but there is no such file')
    require(filter(wanted, NEEDED))
    overrides = {frame: value(frame) for frame in ('odom_frame', 'base_frame') if value(frame)}
    overrides |= {name: number(name, value(name)) for name in ('real_time_factor', 'initial_yaw') if value(name)}
    if value('sensor_seed'):
        overrides |= dict.fromkeys(SEEDS, whole('sensor_seed', value('sensor_seed')))
    for argument, parameter in (('initial_position', 'initial_position'), ('current', 'water.current')):
        if value(argument):
            overrides[parameter] = vector(argument, value(argument))
    if value('publish_clock'):
        overrides |= {'publish_clock': wanted('publish_clock'), 'use_sim_time': not wanted('publish_clock')}
    if wanted('robot_state_publisher'):
        overrides['publish_fin_joints'] = True
    namespace = make_namespace_absolute(
        prefix_namespace(context.launch_configurations.get('ros_namespace'), value('namespace')) or '/').rstrip('/')
    simulator, awaits_recorder = f'{namespace}/manta_sim', False
    if wanted('record'):
        recorders = recorders_of(context)
        recorders[simulator] = recorder_name(namespace)
        own = configured(config, simulator) | overrides
        awaits_recorder = own.get('publish_clock', True) and not own.get('start_paused', False)
        if awaits_recorder:
            overrides['start_paused'] = True
    simulated_time = {'use_sim_time': True}

    def node(package, executable, *parameters, **options):
        return Node(package=package, executable=executable, namespace=value('namespace'),
                    parameters=list(parameters), output='screen', **options)

    started = [node('manta_sim_ros', 'sim_node', str(config), overrides, on_exit=Shutdown(reason='sim_node ended'))]
    if wanted('gait'):
        started.append(node('manta_sim_ros', 'gait_node', simulated_time))
    if wanted('robot_state_publisher'):
        started.append(node('robot_state_publisher', 'robot_state_publisher', simulated_time, {
            'robot_description': urdf(config, f'{namespace}/manta_sim', value('base_frame')),
            'publish_frequency': 100.0}))
    if wanted('rviz'):
        started.append(node('rviz2', 'rviz2', simulated_time, arguments=['-d', value('rviz_config')]))
    if wanted('record'):
        started.append(recorder(namespace, value('bag')))
    if awaits_recorder:
        started.append(OpaqueCoroutine(coroutine=run_when_recorded, ignore_context=True, args=[
            simulator, recorders, get_logger('manta_sim_ros').warning]))
    return started


def recorders_of(context):
    """Return the names of all recorders by those of their simulators, which this and other launch files add to."""
    if not hasattr(context.locals, 'manta_recorders'):
        context.extend_globals({'manta_recorders': {}})
    return context.locals.manta_recorders


def configured(config, node):
    """Return the parameters of a node in a parameter file; the simulator says what is wrong with the file."""
    try:
        return values_for(node, read_sections(config))
    except (OSError, ValueError):
        return {}


def number(name, text):
    """Return the value of an argument as a number with a decimal point, which ROS 2 wants for 2 too."""
    try:
        return float(text)
    except ValueError:
        raise RuntimeError(f'{name} is {text!r}, but must be a number') from None


def whole(name, text):
    """Return the value of an argument as a whole number."""
    try:
        return int(text)
    except ValueError:
        raise RuntimeError(f'{name} is {text!r}, but must be a whole number') from None


def vector(name, text):
    """Return the value of an argument as three numbers with a decimal point each."""
    try:
        x, y, z = yaml.safe_load(text)
        return [float(x), float(y), float(z)]
    except (TypeError, ValueError, yaml.YAMLError):
        raise RuntimeError(f'{name} is {text!r}, but must be three numbers, such as [0, 3, -1]') from None


def urdf(config, node, base_frame):
    """Return the URDF of the robot that a parameter file describes, with the parameters that ROS 2 takes for a node."""
    import xacro

    groups = {}
    path = get_package_share_path('manta_sim_ros') / 'urdf' / 'manta.urdf.xacro'
    try:
        for full_name, value in values_for(node, read_sections(config)).items():
            group, _, name = full_name.rpartition('.')
            (groups.setdefault(group, {}) if group else groups)[name] = value
        with NamedTemporaryFile('w', suffix='.yaml') as file:
            yaml.safe_dump({'/**': {'ros__parameters': groups}}, file)
            file.flush()
            return xacro.process_file(str(path), mappings={'config': file.name, 'base_frame': base_frame}).toxml()
    except (ValueError, xacro.XacroException) as error:
        raise RuntimeError(f'no robot can be made of {config}: {" ".join(str(error).split())}') from error


def recorder(namespace, bag):
    """Return the process that records the topics of the robot in a namespace."""
    bag = bag or f'rosbag2_{datetime.now():%Y_%m_%d-%H_%M_%S}{namespace.replace("/", "_")}'
    if Path(bag).exists():
        raise RuntimeError(f'bag is {bag!r}, but that exists already')
    return ExecuteProcess(
        cmd=['ros2', 'bag', 'record', '--use-sim-time', '--disable-keyboard-controls', '--include-unpublished-topics',
             '--storage', 'mcap', '--output', bag, '--node-name', recorder_name(namespace),
             '--topics', *(topic if topic.startswith('/') else f'{namespace}/{topic}' for topic in RECORDED)],
        output='screen')


def recorder_name(namespace):
    """Return the name of the node that records the robot in a namespace."""
    return f'rosbag2_recorder{namespace.replace("/", "_")}'


def require(arguments):
    """Raise an error that names what these arguments need and is not installed."""
    lacking = {argument: [package for package in NEEDED[argument] if not installed(package)] for argument in arguments}
    missing = [package for packages in lacking.values() for package in packages]
    if missing:
        distribution = environ.get('ROS_DISTRO', '<distribution>')
        names = [f'ros-{distribution}-{package.replace("_", "-")}' for package in missing]
        raise RuntimeError(f'{" and ".join(filter(lacking.get, lacking))} cannot be without {", ".join(missing)}, '
                           f'not installed here: apt install {" ".join(names)}')


def installed(package):
    """Whether a ROS package, or a Python package of its name, is installed."""
    try:
        return bool(get_package_prefix(package))
    except PackageNotFoundError:
        return find_spec(package) is not None
