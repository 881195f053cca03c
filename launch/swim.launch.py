"""Start the simulator and the path follower with a mission, and a figure of the swim at its end.

All arguments of sim.launch.py can be given too, but for `gait`: the path follower is the controller.
"""
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

SHARE = FindPackageShare('manta_sim_ros')


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument('mission',
                              default_value=PathJoinSubstitution([SHARE, 'config', 'missions', 'helix.yaml']),
                              description='mission file; empty: wait for a path on the topic path'),
        DeclareLaunchArgument('config', default_value=PathJoinSubstitution([SHARE, 'config', 'freshwater.yaml']),
                              description='parameter file of the simulator'),
        DeclareLaunchArgument('gains', default_value='',
                              description='parameter file of path_follower; empty: its defaults, for freshwater.yaml'),
        DeclareLaunchArgument('output', default_value='',
                              description='PNG file of path and track, drawn at the end; empty: none is drawn'),
        OpaqueFunction(function=refuse_gait),
        IncludeLaunchDescription(
            PathJoinSubstitution([SHARE, 'launch', 'sim.launch.py']),
            launch_arguments={'gait': 'false', 'config': LaunchConfiguration('config')}.items()),
        OpaqueFunction(function=controller),
    ])


def refuse_gait(context):
    """Raise an error, before anything is started, if the argument `gait` is given."""
    if 'gait' in context.launch_configurations:
        raise RuntimeError(f"gait is {context.launch_configurations['gait']!r}, but swim.launch.py sets it: the path "
                           'follower is the controller')


def controller(context):
    """Return the path follower, and the node that records the swim and ends everything at its end."""
    def value(name):
        return LaunchConfiguration(name).perform(context)

    simulated_time = {'use_sim_time': True}
    options = {'namespace': value('namespace'), 'package': 'manta_sim_ros', 'output': 'screen'}
    gains = [value('gains')] if value('gains') else []
    return [
        Node(executable='path_follower', parameters=[
            *gains, simulated_time, {'mission': value('mission'), 'robot': value('config')}], **options),
        Node(executable='track_node', parameters=[simulated_time, {'output': value('output')}],
             on_exit=Shutdown(reason='the swim ended'), **options),
    ]
