"""
Computed torque in a ROS graph: ``ros2 launch lip_id_ros track.launch.py model_path:=panda.npz``.

`serve` adds efforts to the plan of `reference`; `computed_torque` adds feedback; the simulated arm
moves by a millisecond for each torque.

"""

from launch import LaunchDescription

from lip_id_ros.nodes.launch_arguments import argument, AS_IN_FILE, common_arguments, node, start

PLAN = 'plan_with_effort'


def generate_launch_description() -> LaunchDescription:
    n_joints = {'n_joints': int}
    motion = {'amplitude': float, 'horizon': float}
    return LaunchDescription(
        [
            argument('model_path', None, 'Model of the Panda.'),
            *common_arguments('track.yaml', 'serve and computed_torque'),
            argument(
                'autostart', '', f'Whether serve configures and activates itself{AS_IN_FILE}.'
            ),
            argument('n_joints', '', f'Number of joints, from the base{AS_IN_FILE}.'),
            argument('amplitude', '', f'Amplitude at the horizon [rad]{AS_IN_FILE}.'),
            argument('horizon', '', f'Length of the motion [s]{AS_IN_FILE}.'),
            *start(
                node(
                    'simulated_arm',
                    given=n_joints,
                    topics=[('command', 'computed_torque/command')],
                ),
                node('computed_torque', topics=[('~/joint_trajectory', PLAN)]),
                node(
                    'serve',
                    topics=[
                        ('~/desired_trajectory', 'desired_trajectory'),
                        ('~/trajectory_with_effort', PLAN),
                    ],
                    given={'model_path': str, 'autostart': bool},
                ),
                node('reference', given=n_joints | motion),
            ),
        ]
    )
