"""
From nothing to a model: ``ros2 launch lip_id_ros excite.launch.py params_file:=my_robot.yaml``.

`excite` moves the arm, `train` records and fits, and `serve` waits for the model. The parameter
file has a section for each, as config/panda.yaml for the latter two and config/excite_node.yaml.

"""

from launch import LaunchDescription

from lip_id_ros.nodes.launch_arguments import launch_of


def generate_launch_description() -> LaunchDescription:
    return launch_of('excite', 'train', 'serve', autostart='false')
