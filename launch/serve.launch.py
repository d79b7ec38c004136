"""Serve a model: ``ros2 launch lip_id_ros serve.launch.py model_path:=model.npz``."""

from launch import LaunchDescription

from lip_id_ros.nodes.launch_arguments import launch_of


def generate_launch_description() -> LaunchDescription:
    return launch_of('serve', params_file='serve.yaml')
