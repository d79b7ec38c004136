"""Every kind of finding: its code, how much it matters, what it means and what to do."""

from __future__ import annotations

from lip_id_ros.health.checks import effort, excitation, naming, resolution, timing, velocity
from lip_id_ros.health.finding import Check, Severity

CHECKS: tuple[Check, ...] = (
    Check(
        'short',
        Severity.WARNING,
        'The recording lasts less than 20 s.',
        'record a minute or more',
        timing.short,
    ),
    Check(
        'low_rate',
        Severity.WARNING,
        'Samples come at less than 20 Hz.',
        'raise the publishing rate, or move slowly enough for it',
        timing.low_rate,
    ),
    Check(
        'jitter',
        Severity.NOTE,
        'Steps between samples scatter by more than a fifth.',
        'let the driver stamp the messages when it reads the encoders',
        timing.jitter,
    ),
    Check(
        'gaps',
        Severity.WARNING,
        'More than six gaps in a minute; motion is cut at each, and its edges are lost.',
        "record on the robot's own computer, or set preprocessing.max_gap_s",
        timing.gaps,
    ),
    Check(
        'dropped',
        Severity.WARNING,
        'More than one message in a hundred cannot be used.',
        'look at the reasons, and choose topic and joints by recording.topic and recording.joints',
        timing.dropped,
    ),
    Check(
        'stale',
        Severity.NOTE,
        'More than one sample in a hundred repeats the one before under a new stamp.',
        'nothing needs to be done, they are left out; better publish no faster than the driver '
        'reads',
        timing.stale,
    ),
    Check(
        'position_unit',
        Severity.WARNING,
        'A revolute joint turns by more than five turns.',
        'see whether positions are in degrees, and publish them in rad',
        excitation.far,
    ),
    Check(
        'velocity_missing',
        Severity.NOTE,
        'No velocities were recorded.',
        'nothing needs to be done, positions are differentiated; recorded velocities are often '
        'less noisy',
        velocity.missing,
    ),
    Check(
        'velocity_constant',
        Severity.WARNING,
        'A velocity never changes although the joint moves.',
        'set preprocessing.velocity to differentiated',
        velocity.constant,
    ),
    Check(
        'velocity_sign',
        Severity.WARNING,
        'A velocity has the other sign than the change of position.',
        'set preprocessing.velocity to differentiated, and ask which of the two signs the effort '
        'has',
        velocity.turned,
    ),
    Check(
        'velocity_scale',
        Severity.WARNING,
        'A velocity is less than 0.8 or more than 1.25 times the change of position.',
        'correct the unit in the driver, or set preprocessing.velocity to differentiated',
        velocity.scaled,
    ),
    Check(
        'velocity_unlike',
        Severity.WARNING,
        'A velocity correlates with the change of position by less than 0.7.',
        'see whether it belongs to another joint, or set preprocessing.velocity to differentiated',
        velocity.unlike,
    ),
    Check(
        'velocity_delay',
        Severity.WARNING,
        'A velocity is more than 10 ms behind or ahead of the position.',
        'set preprocessing.velocity to differentiated',
        velocity.late,
    ),
    Check(
        'effort_missing',
        Severity.ERROR,
        'No efforts were recorded.',
        'record them with a driver that measures torque or current',
        effort.missing,
    ),
    Check(
        'effort_constant',
        Severity.ERROR,
        'An effort never changes.',
        'let the driver publish it, or leave the joint out by recording.joints',
        effort.constant,
    ),
    Check(
        'effort_clipped',
        Severity.WARNING,
        'At least 0.5 % of the samples lie on a flat end of the range of an effort.',
        'move more slowly or with less load, since what was cut off cannot be learned',
        effort.clipped,
    ),
    Check(
        'effort_sign',
        Severity.WARNING,
        'The friction in an effort would drive the motion.',
        'see whether gravity has the right sign, and turn the sign by a negative value in '
        'recording.effort_scale',
        effort.turned,
    ),
    Check(
        'effort_unrelated',
        Severity.WARNING,
        'The motion explains less than 15 % of the variance of an effort.',
        'see whether it belongs to another joint, or leave the joint out by recording.joints',
        effort.unrelated,
    ),
    Check(
        'effort_delay',
        Severity.WARNING,
        'Efforts fit the motion clearly better when they are shifted in time. Only friction, '
        'gravity and inertia of each joint by itself are asked, so that a delay below one sample '
        'or of an arm without friction may not be seen.',
        'see whether the driver filters one of them, and record both with the same delay',
        effort.late,
    ),
    Check(
        'effort_small',
        Severity.NOTE,
        'No effort of the arm exceeds 5.',
        'if it is a motor current or a share of the maximum, give motor constant times gear ratio '
        'as recording.effort_scale',
        effort.small,
    ),
    Check(
        'effort_huge',
        Severity.WARNING,
        'An effort exceeds 5000.',
        'give the factor to N m as recording.effort_scale',
        effort.huge,
    ),
    Check(
        'coarse',
        Severity.NOTE,
        'A signal comes in steps: a position of more than 1 %, a velocity or effort of more than '
        '10 % of its standard deviation.',
        'record it with more digits, or move more',
        resolution.coarse,
    ),
    Check(
        'frozen',
        Severity.WARNING,
        'A velocity or effort stays exactly the same for more than a second while the joint moves '
        'over a fifth of its range; not judged where it comes in steps.',
        'leave this part of the recording out',
        resolution.frozen,
    ),
    Check(
        'position_frozen',
        Severity.WARNING,
        'A position stays exactly the same for more than a second while the velocity goes on.',
        'leave this part of the recording out',
        resolution.position_frozen,
    ),
    Check(
        'still',
        Severity.WARNING,
        'A joint does not move.',
        'move it, or leave it out by recording.joints if it never will',
        excitation.still,
    ),
    Check(
        'little_range',
        Severity.WARNING,
        'A joint moves over less than 0.3 rad or 0.05 m.',
        'move it over the range that will be used, since the model knows only that',
        excitation.little_range,
    ),
    Check(
        'slow',
        Severity.WARNING,
        'The root mean square velocity of a joint is below 0.05 rad/s or 0.005 m/s.',
        'move it faster, or its viscous friction cannot be told from Coulomb friction',
        excitation.slow,
    ),
    Check(
        'gentle',
        Severity.NOTE,
        'The acceleration of a joint exceeds 0.5 rad/s^2 or 0.05 m/s^2 in less than a hundredth '
        'of the samples.',
        'accelerate more, or its inertia is not identified (slow motions are not harmed)',
        excitation.gentle,
    ),
    Check(
        'one_way',
        Severity.WARNING,
        'Less than a tenth of the way of a joint goes in the other direction.',
        'move it back and forth, or Coulomb friction cannot be told from gravity',
        excitation.one_way,
    ),
    Check(
        'together',
        Severity.WARNING,
        'The velocities of two joints correlate by more than 0.97.',
        'give each joint a motion of its own, or their shares cannot be told apart',
        excitation.together,
    ),
    Check(
        'resting',
        Severity.NOTE,
        'All joints rest in more than half of the recording.',
        'record while the arm moves',
        excitation.resting,
    ),
    Check(
        'joint_order',
        Severity.WARNING,
        'Names tell of another order than from base to tip: wrist before elbow, 10 before 2.',
        'name the joints from base to tip in recording.joints',
        naming.order,
    ),
    Check(
        'gripper_joint',
        Severity.NOTE,
        'By its name a joint belongs to a gripper.',
        'leave it out by recording.joints unless it is to be identified',
        naming.gripper,
    ),
)
