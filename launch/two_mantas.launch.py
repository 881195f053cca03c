"""Start two robots in one world, manta_1 and manta_2: one clock, one tree of frames, a gait each."""
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

BOOLEANS = ['true', 'false', 'True', 'False']
SHARE = FindPackageShare('manta_sim_ros')
PASSED_ON = ('config', 'real_time_factor', 'record')
SET_HERE = ('namespace', 'publish_clock', 'odom_frame', 'base_frame', 'rviz_config', 'robot_state_publisher', 'bag')
STRAIGHT = {'durations': [20.0], 'right_amplitude_degrees': [40.0]}
LEFT_CIRCLE = {'durations': [20.0], 'left_amplitude_degrees': [20.0], 'right_amplitude_degrees': [40.0]}
APART = '[0.0, 3.0, 0.0]'  # to the left


def generate_launch_description():
    rviz = LaunchConfiguration('rviz')
    return LaunchDescription([
        OpaqueFunction(function=refuse_what_is_set_here),
        DeclareLaunchArgument('config', default_value=PathJoinSubstitution([SHARE, 'config', 'manta.yaml']),
                              description='parameter file of both simulators'),
        DeclareLaunchArgument('gait', default_value='true', choices=BOOLEANS,
                              description='start a gait_node each: manta_1 swims straight, manta_2 a circle'),
        DeclareLaunchArgument('real_time_factor', default_value='',
                              description='simulated time over elapsed time; empty: as in config'),
        DeclareLaunchArgument('rviz', default_value='false', choices=BOOLEANS,
                              description='start RViz with both robots'),
        DeclareLaunchArgument('record', default_value='false', choices=BOOLEANS,
                              description='record each robot to a bag of its own'),
        robot('manta_1', publish_clock='true', rviz=rviz, robot_state_publisher=rviz),
        robot('manta_2', publish_clock='false', initial_position=APART, sensor_seed='1',
              robot_state_publisher=rviz, rviz='false'),  # set one after the other
        controller('manta_1', STRAIGHT),
        controller('manta_2', LEFT_CIRCLE),
    ])


def refuse_what_is_set_here(context):
    """Raise an error, before anything is started, if an argument is given that each robot has its own value of."""
    for name in SET_HERE:
        if name in context.launch_configurations:
            raise RuntimeError(f'{name} is {context.launch_configurations[name]!r}, but two_mantas.launch.py sets it '
                               'for each robot: start sim.launch.py once for each, or leave it out')


def robot(name, **arguments):
    """Return what starts one robot; in a group, as arguments would hold for all that is included later."""
    arguments |= {argument: LaunchConfiguration(argument) for argument in PASSED_ON}
    arguments |= {
        'namespace': name, 'odom_frame': 'odom', 'base_frame': f'{name}/base_link', 'gait': 'false', 'bag': '',
        'rviz_config': PathJoinSubstitution([SHARE, 'rviz', 'two_mantas.rviz'])}
    return GroupAction([IncludeLaunchDescription(
        PathJoinSubstitution([SHARE, 'launch', 'sim.launch.py']), launch_arguments=arguments.items())])


def controller(name, gait):
    """Return the gait_node of one robot."""
    return Node(package='manta_sim_ros', executable='gait_node', namespace=name, output='screen',
                parameters=[{'use_sim_time': True}, gait], condition=IfCondition(LaunchConfiguration('gait')))
