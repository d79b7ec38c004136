"""What the demo records, by topic."""

JOINT_STATES = '/joint_states'
REFERENCE = '/desired_trajectory'
TORQUE = '/serve/feedforward_torque'
KINETIC = '/serve/kinetic_energy'
POTENTIAL = '/serve/potential_energy'
PLAN_WITH_EFFORT = '/serve/trajectory_with_effort'

TYPES = {
    JOINT_STATES: 'sensor_msgs/msg/JointState',
    REFERENCE: 'trajectory_msgs/msg/JointTrajectory',
    TORQUE: 'sensor_msgs/msg/JointState',
    KINETIC: 'std_msgs/msg/Float64',
    POTENTIAL: 'std_msgs/msg/Float64',
    PLAN_WITH_EFFORT: 'trajectory_msgs/msg/JointTrajectory',
}
