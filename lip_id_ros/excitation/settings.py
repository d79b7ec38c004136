"""Settings of the design of a motion."""

from __future__ import annotations

from dataclasses import dataclass, field

from lip_id_ros.settings import setting, Settings

ERROR, INFORMATION = 'error', 'information'
NONE = 'none'
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
        'Where the motion starts and ends; empty for the middles of the position ranges.',
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


@dataclass(frozen=True)
class SpaceSettings(Settings):
    """Where joints and tool may be, in the frame of the base; needs a URDF or a model."""

    floor_m: float | str = setting(
        NONE, 'Height of the floor.', unit='m', minimum=-LARGEST, maximum=LARGEST, choices=(NONE,)
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
        'Place of the tool in the frame of the last joint, x, y, z; empty for its origin.',
        unit='m',
        minimum=-LARGEST,
        maximum=LARGEST,
    )
    margin_m: float = setting(
        0.1,
        'Distance that the origins of joints and the tool keep: half the thickness of the arm.',
        unit='m',
        minimum=0.0,
        maximum=LARGEST,
    )


@dataclass(frozen=True)
class SearchSettings(Settings):
    """The search for the best motion."""

    criterion: str = setting(
        ERROR,
        'What is best where there is a model: the least expected error of torques, or the most '
        'information on its parameters (D-optimality).',
        choices=(ERROR, INFORMATION),
    )
    draws: int = setting(30, 'Random motions, of which the best are improved.', minimum=1)
    starts: int = setting(3, 'How many of them are improved.', minimum=1)
    steps: int = setting(150, 'Steps of the ascent of each.', minimum=0)
    seed: int = setting(
        0, 'Seed of every random choice; the same seed gives the same motion.', minimum=0
    )


@dataclass(frozen=True)
class ExcitationConfig:
    """All settings of the design of a motion."""

    motion: MotionSettings = field(default_factory=MotionSettings)
    space: SpaceSettings = field(default_factory=SpaceSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
