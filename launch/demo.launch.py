"""A simulated Panda, `train` and `serve`, which ``python -m examples.demo.ros`` conducts."""

from launch import LaunchDescription
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution

from lip_id_ros.nodes.launch_arguments import argument, common_arguments, node, start


def generate_launch_description() -> LaunchDescription:
    def in_output(name: str) -> PathJoinSubstitution:
        return PathJoinSubstitution([LaunchConfiguration('output'), name])

    model = {'model_path': in_output('model.npz')}
    data = {'dataset_path': in_output('training.npz'), 'unsaved_path': in_output('unsaved.mcap')}
    return LaunchDescription(
        [
            argument('output', '.', 'Folder of the model and the data.'),
            *common_arguments('demo.yaml', 'simulated_panda, train and serve'),
            *start(
                node('simulated_panda'),
                node('train', model | data),
                node('serve', model, [('~/desired_trajectory', 'desired_trajectory')]),
            ),
        ]
    )
