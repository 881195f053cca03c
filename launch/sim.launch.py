"""Start the simulator and, unless told otherwise, the example controller beside it."""
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    default_config = PathJoinSubstitution([FindPackageShare('manta_sim_ros'), 'config', 'manta.yaml'])
    return LaunchDescription([
        DeclareLaunchArgument('namespace', default_value='', description='Namespace of both nodes'),
        DeclareLaunchArgument('config', default_value=default_config, description='Parameter file of the simulator'),
        DeclareLaunchArgument('gait', default_value='true', description='Whether to start gait_node: true or false'),
        Node(
            package='manta_sim_ros',
            executable='sim_node',
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('config')],
            output='screen',
        ),
        Node(
            package='manta_sim_ros',
            executable='gait_node',
            namespace=LaunchConfiguration('namespace'),
            parameters=[{'use_sim_time': True}],
            output='screen',
            condition=IfCondition(LaunchConfiguration('gait')),
        ),
    ])
