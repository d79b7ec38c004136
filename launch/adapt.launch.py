"""Follow an arm that changes: ``ros2 launch lip_id_ros adapt.launch.py model_path:=model.npz``."""

from launch import LaunchDescription

from lip_id_ros.nodes.launch_arguments import launch_of


def generate_launch_description() -> LaunchDescription:
    return launch_of('adapt', params_file='adapt.yaml')
