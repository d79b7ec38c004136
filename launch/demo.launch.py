"""A simulated Panda, `train` and `serve`, which ``python -m examples.demo.ros`` conducts."""

from launch import LaunchDescription

from lip_id_ros.nodes.launch_arguments import launch_of


def generate_launch_description() -> LaunchDescription:
    return launch_of(
        *('simulated_panda', 'train', 'serve'),
        params_file='demo.yaml',
        autostart='false',
        desired_trajectory='desired_trajectory',
    )
