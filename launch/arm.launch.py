"""
Both nodes of one arm: ``ros2 launch lip_id_ros arm.launch.py params_file:=panda.yaml``.

The parameter file has a section for each node, as config/panda.yaml. `serve` waits unconfigured
for the model that `train` writes, unless `autostart` is true.

"""

from launch import LaunchDescription

from lip_id_ros.nodes.launch_arguments import launch_of


def generate_launch_description() -> LaunchDescription:
    return launch_of('train', 'serve', autostart='false')
