"""
Computed torque in a ROS graph: ``ros2 launch lip_id_ros track.launch.py model_path:=panda.npz``.

`serve` adds efforts to the plan of `reference`; `computed_torque` adds feedback; the simulated arm
moves by a millisecond for each torque.

"""

from launch import LaunchDescription
from launch.substitutions import LaunchConfiguration

from lip_id_ros.nodes.launch_arguments import argument, common_arguments, node, value

PLAN = 'plan_with_effort'


def generate_launch_description() -> LaunchDescription:
    n_joints = {'n_joints': value('n_joints', int)}
    motion = {name: value(name, float) for name in ('amplitude', 'horizon')}
    model = {
        'model_path': LaunchConfiguration('model_path'),
        'autostart': value('autostart', bool),
    }
    return LaunchDescription(
        [
            argument('model_path', None, 'Model of the Panda.'),
            *common_arguments('track.yaml', 'serve and computed_torque'),
            argument('autostart', 'true', 'Whether serve configures and activates itself.'),
            argument('n_joints', '7', 'Number of joints, from the base.'),
            argument('amplitude', '0.6', 'Amplitude at the horizon [rad].'),
            argument('horizon', '10.0', 'Length of the motion [s].'),
            node('simulated_arm', n_joints, [('command', 'computed_torque/command')]),
            node('computed_torque', topics=[('~/joint_trajectory', PLAN)]),
            node(
                'serve',
                model,
                [
                    ('~/desired_trajectory', 'desired_trajectory'),
                    ('~/trajectory_with_effort', PLAN),
                ],
            ),
            node('reference', n_joints | motion),
        ]
    )
