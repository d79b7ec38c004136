"""
Both nodes of one arm: ``ros2 launch lip_id_ros arm.launch.py params_file:=panda.yaml``.

The parameter file has a section for each node, as config/panda.yaml. `serve` waits unconfigured
for the model that `train` makes, unless `autostart` is true.

"""

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

SHARED = ('params_file', 'namespace', 'joint_states', 'use_sim_time')
OF_SERVE = ('model_path', 'desired_trajectory', 'trajectory_with_effort', 'autostart')


def generate_launch_description() -> LaunchDescription:
    def included(name: str, arguments: tuple[str, ...]) -> IncludeLaunchDescription:
        path = str(get_package_share_path('lip_id_ros') / 'launch' / name)
        handed_on = {argument: LaunchConfiguration(argument) for argument in arguments}
        return IncludeLaunchDescription(
            PythonLaunchDescriptionSource(path), launch_arguments=handed_on.items()
        )

    return LaunchDescription(
        [
            DeclareLaunchArgument('params_file', description='Parameters of train and serve.'),
            DeclareLaunchArgument(
                'model_path',
                default_value='model.npz',
                description='Model to serve: what model_path of train says.',
            ),
            DeclareLaunchArgument('namespace', default_value='', description='Of the robot.'),
            DeclareLaunchArgument(
                'joint_states',
                default_value='joint_states',
                description='Topic of the measured joint states.',
            ),
            DeclareLaunchArgument(
                'desired_trajectory',
                default_value='~/desired_trajectory',
                description='Topic of the references and plans.',
            ),
            DeclareLaunchArgument(
                'trajectory_with_effort',
                default_value='~/trajectory_with_effort',
                description='Topic of plans with efforts.',
            ),
            DeclareLaunchArgument(
                'use_sim_time', default_value='false', description='Follow /clock.'
            ),
            DeclareLaunchArgument(
                'autostart', default_value='false', description='Serve from the start.'
            ),
            included('train.launch.py', SHARED),
            included('serve.launch.py', SHARED + OF_SERVE),
        ]
    )
