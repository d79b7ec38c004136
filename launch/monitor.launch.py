"""Watch an arm: ``ros2 launch lip_id_ros monitor.launch.py model_path:=model.npz``."""

from launch import LaunchDescription

from lip_id_ros.nodes.launch_arguments import launch_of


def generate_launch_description() -> LaunchDescription:
    return launch_of('monitor', params_file='monitor.yaml')
