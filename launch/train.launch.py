"""Record and fit: ``ros2 launch lip_id_ros train.launch.py params_file:=my_robot.yaml``."""

from launch import LaunchDescription

from lip_id_ros.nodes.launch_arguments import launch_of


def generate_launch_description() -> LaunchDescription:
    return launch_of('train', params_file='train.yaml')
