"""Settings of the design of a motion."""

from __future__ import annotations

from dataclasses import dataclass, field

from lip_id_ros.settings import executor_setting, setting, Settings
from lip_id_ros.settings.settings import AT_START, PER_JOINT
from lip_id_ros.signals.torque_steps import LimitsFrom

BASE, NONE = 'base', 'none'
AS_MOTION = 'motion'
LARGEST = 1e6
LONGEST_S = 3600.0


def _per_joint(description: str, unit: str) -> tuple[float, ...]:
    numbers: tuple[float, ...] = setting(
        (), description, unit=unit, minimum=-LARGEST, maximum=LARGEST
    )
    return numbers


@dataclass(frozen=True)
class MotionSettings(Settings):
    """The motion, and the limits that it keeps; lists have one number, or one for each joint."""

    joints: tuple[str, ...] = setting(
        (), 'Joints from base to tip; empty for all that move in the URDF, or those of the model.'
    )
    posture: tuple[float, ...] = _per_joint(
        'Where the motion starts and ends; empty for a posture with room around it, near the '
        'middles of the position ranges.',
        'rad or m',
    )
    duration_s: float = setting(
        20.0, 'Length of the motion.', unit='s', minimum=0.1, maximum=LONGEST_S
    )
    harmonics: int = setting(
        5,
        'Number of multiples of 1 / duration_s in the motion of each joint.',
        minimum=2,
        maximum=200,
    )
    rate_hz: float = setting(
        100.0, 'Rate at which the motion is written.', unit='Hz', minimum=1.0, maximum=1e5
    )
    lower: tuple[float, ...] = _per_joint(
        'Lowest positions; empty for those of the URDF.', 'rad or m'
    )
    upper: tuple[float, ...] = _per_joint(
        'Highest positions; empty for those of the URDF.', 'rad or m'
    )
    velocity: tuple[float, ...] = _per_joint(
        'Largest velocities; empty for those of the URDF.', 'rad/s or m/s'
    )
    acceleration: tuple[float, ...] = _per_joint(
        'Largest accelerations; empty for full velocity after 0.25 s.', 'rad/s^2 or m/s^2'
    )
    jerk: tuple[float, ...] = _per_joint(
        'Largest jerks; empty for full acceleration after 0.1 s.', 'rad/s^3 or m/s^3'
    )
    torque_limits: tuple[float, ...] = _per_joint(
        'Largest torques that a model may predict; empty for those of the URDF.', 'N m or N'
    )
    share: float = setting(
        0.9,
        'Share of the limits of the URDF that the motion may use.',
        minimum=0.01,
        maximum=1.0,
    )
    size: float = setting(
        0.3,
        'Share of the way from the posture to each limit of the positions, and of all other '
        'limits but those of torques, that a motion may use: the node excite grows up to it.',
        minimum=0.001,
        maximum=1.0,
    )


@dataclass(frozen=True)
class SpaceSettings(Settings):
    """Where links and tool may be, in the frame of a URDF, or of a model fitted with one."""

    floor_m: float | str = setting(
        BASE,
        'Height of the floor; the word base: of the link that carries the first joint; the word '
        'none: no floor.',
        unit='m',
        minimum=-LARGEST,
        maximum=LARGEST,
        choices=(BASE, NONE),
    )
    boxes: tuple[float, ...] = setting(
        (),
        'Boxes to stay out of, each lowest x, y, z and highest x, y, z.',
        unit='m',
        minimum=-LARGEST,
        maximum=LARGEST,
    )
    keep_in: tuple[float, ...] = setting(
        (), 'The box to stay in, likewise.', unit='m', minimum=-LARGEST, maximum=LARGEST
    )
    tool: tuple[float, ...] = setting(
        (),
        'Place of the tool in the frame of the last joint, x, y, z; empty for none beyond the '
        'shapes of the URDF.',
        unit='m',
        minimum=-LARGEST,
        maximum=LARGEST,
    )
    margin_m: float = setting(
        0.05,
        'Distance that links and tool keep from the floor, the boxes and the ends of keep_in.',
        unit='m',
        minimum=0.001,
        maximum=LARGEST,
    )
    self_distance_m: float | str = setting(
        0.05,
        'Distance that the links keep from each other; the word none: any.',
        unit='m',
        minimum=0.001,
        maximum=LARGEST,
        choices=(NONE,),
    )
    radius_m: float = setting(
        0.1,
        'Half the thickness of links that have no shape in the URDF.',
        unit='m',
        minimum=0.001,
        maximum=LARGEST,
    )


@dataclass(frozen=True)
class SearchSettings(Settings):
    """The search for the best motion."""

    draws: int = setting(30, 'Random motions, of which the best is taken.', minimum=1)
    seed: int = setting(
        0, 'Seed of every random choice; the same seed gives the same motion.', minimum=0
    )


@dataclass(frozen=True)
class TargetSettings(Settings):
    """The box of states in which torques will be wanted; what is empty is as for the motion."""

    lower: tuple[float, ...] = _per_joint('Lowest positions.', 'rad or m')
    upper: tuple[float, ...] = _per_joint('Highest positions.', 'rad or m')
    velocity: tuple[float, ...] = _per_joint('Largest velocities.', 'rad/s or m/s')
    acceleration: tuple[float, ...] = _per_joint('Largest accelerations.', 'rad/s^2 or m/s^2')
    rate_hz: float | str = setting(
        AS_MOTION,
        'Rate at which these motions repeat, the cycles of a task in a second; the word motion: '
        'once in motion.duration_s.',
        unit='Hz',
        minimum=1.0 / LONGEST_S,
        maximum=10.0,
        choices=(AS_MOTION,),
    )


@dataclass(frozen=True)
class ExcitationConfig:
    """All settings of the design of a motion."""

    motion: MotionSettings = field(default_factory=MotionSettings)
    space: SpaceSettings = field(default_factory=SpaceSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
    targets: TargetSettings = field(default_factory=TargetSettings)


@dataclass(frozen=True)
class RoundSettings(Settings):
    """The node `excite`: how motions are executed, one after the other."""

    controller_action: str = setting(
        '',
        'Action FollowJointTrajectory of the controller that moves the arm; must be given.',
        applies=AT_START,
    )
    trainer: str = setting(
        'train', 'Name of the node train, which records and fits.', applies=AT_START
    )
    config_path: str = setting(
        '',
        'Settings of the motions, as those of `lip_id excite --config`; empty: the usual ones.',
        applies=AT_START,
    )
    use_robot_description: bool = setting(
        True,
        'Take joints, limits and the shapes of the links from the URDF of the topic '
        'robot_description; without it nobody checks floor and self-collision.',
        applies=AT_START,
    )
    model_path: str = setting(
        '', 'Model that the first motion starts from; empty: nothing is known.', applies=AT_START
    )
    motion_path: str = setting(
        'motion.yaml',
        'Where motions are written, each with its number added to the name.',
        applies=AT_START,
    )
    report_path: str = setting(
        '',
        'Folder of a page that shows a motion, with its number added to the name; empty for none.',
        applies=AT_START,
    )
    rounds: int = setting(3, 'Most motions.', minimum=1, maximum=100, applies=AT_START)
    enough_percent: float = setting(
        0.0,
        'No further motion once the standard deviations of torques are below this, at every '
        'joint, in percent of the root mean square torques of motions within all limits.',
        unit='%',
        minimum=0.0,
        maximum=100.0,
        applies=AT_START,
    )
    first_size: float = setting(
        0.1,
        'Size of the first motion where nothing is known, motion.size at most.',
        minimum=0.001,
        maximum=1.0,
        applies=AT_START,
    )
    confirm: bool = setting(
        True, 'Whether each motion waits for the service confirm.', applies=AT_START
    )
    start_tolerance: tuple[float, ...] = setting(
        (0.02,),
        f'Longest way from the arm to the posture before a motion. {PER_JOINT}',
        unit='rad or m',
        minimum=0.0,
        applies=AT_START,
    )
    tracking_tolerance: tuple[float, ...] = setting(
        (0.1,),
        'Longest way from the arm to where it should be before the motion is stopped. '
        f'{PER_JOINT}',
        unit='rad or m',
        minimum=0.0,
        applies=AT_START,
    )
    effort_limits: tuple[float, ...] = setting(
        (),
        'Largest efforts of the joint states, in their own unit, before the motion is stopped. '
        f'{PER_JOINT}',
        minimum=0.0,
        applies=AT_START,
        old_values={'none': 'effort_limits_from: none'},
    )
    effort_limits_from: str = setting(
        'parameters',
        'Whether effort_limits are given, or there are none.',
        choices=(LimitsFrom.PARAMETERS, LimitsFrom.NONE),
        applies=AT_START,
    )
    stale_timeout_s: float = setting(
        0.1,
        'Longest silence of the joint states before the motion is stopped.',
        unit='s',
        minimum=0.001,
        maximum=60.0,
        applies=AT_START,
    )
    executor: str = executor_setting()
