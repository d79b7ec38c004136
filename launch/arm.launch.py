"""
Both nodes of one arm: ``ros2 launch lip_id_ros arm.launch.py params_file:=panda.yaml``.

The parameter file has a section for each node, as config/panda.yaml. `serve` waits unconfigured
for the model that `train` writes, unless `autostart` is true.

"""

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

from lip_id_ros.nodes.launch_arguments import argument, common_arguments, JOINT_STATES

SHARED = ('params_file', 'namespace', 'joint_states', 'use_sim_time')
OF_SERVE = ('model_path', 'desired_trajectory', 'trajectory_with_effort', 'autostart')


def generate_launch_description() -> LaunchDescription:
    def included(name: str, names: tuple[str, ...]) -> IncludeLaunchDescription:
        path = str(get_package_share_path('lip_id_ros') / 'launch' / name)
        return IncludeLaunchDescription(
            PythonLaunchDescriptionSource(path),
            launch_arguments={each: LaunchConfiguration(each) for each in names}.items(),
        )

    return LaunchDescription(
        [
            *common_arguments(None, 'train and serve'),
            argument(*JOINT_STATES),
            argument('model_path', 'model.npz', 'Model to serve: the model_path of train.'),
            argument(
                'desired_trajectory',
                '~/desired_trajectory',
                'Topic of the references and plans.',
            ),
            argument(
                'trajectory_with_effort',
                '~/trajectory_with_effort',
                'Topic of plans with efforts.',
            ),
            argument('autostart', 'false', 'Whether serve configures and activates itself.'),
            included('train.launch.py', SHARED),
            included('serve.launch.py', SHARED + OF_SERVE),
        ]
    )
