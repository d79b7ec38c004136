"""The settings of a fit, from the recording to the hyperparameters."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from lip_id_ros.errors import ConfigError
from lip_id_ros.joint_types import JOINT_TYPES
from lip_id_ros.settings.settings import setting, Settings

LARGEST = 1e9
"""Magnitude of factors and offsets of efforts, far beyond any drive: larger ones overflow."""

LONGEST_DELAY_S = 1.0
AUTO = -1.0
"""The cut-off that is still to be chosen."""


@dataclass(frozen=True)
class RecordingSettings(Settings):
    """The topic and joints of a recording, and the meaning of its efforts."""

    topic: str = setting(
        '',
        'Topic to read in bags, or several separated by commas; empty for the only one, or '
        '/joint_states.',
    )
    joints: tuple[str, ...] = setting(
        (),
        'Joints from base to tip; empty for those of the first message that can be used, in its '
        'order.',
    )
    clock: str = setting(
        'auto',
        'Time stamps of bags; auto for those of the headers where they advance, else those of '
        'reception.',
        choices=('auto', 'header', 'receive'),
    )
    joint_types: tuple[str, ...] = setting(
        (), 'Type of each joint; empty for all revolute.', choices=JOINT_TYPES
    )
    effort_scale: tuple[float, ...] = setting(
        (),
        'Factor from recorded effort to torque or force, per joint (motor constant times gear '
        'ratio where a current is recorded, negative to turn the sign); empty for 1.',
        unit='N m or N per unit of effort',
        minimum=-LARGEST,
        maximum=LARGEST,
    )
    effort_offset: tuple[float, ...] = setting(
        (),
        'Added to the scaled effort, per joint; empty for 0.',
        unit='N m or N',
        minimum=-LARGEST,
        maximum=LARGEST,
    )
    effort_delay_s: tuple[float, ...] = setting(
        (),
        'How much later than positions the efforts of each joint were measured; they are shifted '
        'back by it. Negative where they were earlier; empty for 0.',
        unit='s',
        minimum=-LONGEST_DELAY_S,
        maximum=LONGEST_DELAY_S,
    )
    gravity_compensated: bool = setting(
        False, 'The recorded effort excludes gravity, so no potential energy can be learned.'
    )


@dataclass(frozen=True)
class PreprocessingSettings(Settings):
    """The steps from raw samples to a data set."""

    cutoff_hz: float = setting(
        4.0,
        'Cut-off of the zero-phase low-pass on positions, velocities and torques; 0, or half the '
        'sampling rate and above, for none; -1 to choose it, the derivative and the delays of '
        'efforts by the prediction of left-out blocks.',
        unit='Hz',
        minimum=AUTO,
        old_values={'auto': '-1'},
    )
    velocity: str = setting(
        'recorded',
        'Velocities as recorded, where they agree with the positions, or the derivative of the '
        'positions.',
        choices=('recorded', 'differentiated'),
    )
    derivative: str = setting(
        'savitzky_golay',
        'Derivative of smooth samples: five-point polynomials, or differences of the two '
        'neighbours.',
        choices=('savitzky_golay', 'central_differences'),
    )
    edge_periods: float = setting(
        1.0,
        'Periods of the cut-off that are dropped at each end of a segment, where the low-pass has '
        'samples on one side only.',
        minimum=0.0,
    )
    max_gap_s: float = setting(
        0.0,
        'A longer step between samples begins a new segment; 0 for five times the median step, or '
        'a quarter of the period of the cut-off if that is longer.',
        unit='s',
        minimum=0.0,
        maximum=60.0,
    )
    min_segment_s: float = setting(
        1.0, 'Shorter segments are dropped and counted.', unit='s', minimum=0.0
    )
    decimate: int = setting(
        0,
        'Keep every k-th sample; 0 for about four in each period of the cut-off, since the '
        'low-pass removes everything faster.',
        minimum=0,
    )
    min_velocity: float = setting(
        -1.0,
        'Fit without the samples at which a joint is slower than this share of its root mean '
        'square velocity, where the sign of friction is unclear; all are kept where fewer than a '
        'quarter would remain; 0 keeps all; -1 keeps all for an arm (articulated), whose noise '
        'grows near rest, and is 0.05 for other kernels.',
        minimum=-1.0,
    )
    max_samples: int = setting(0, 'Keep at most this many samples; 0 for all.', minimum=0)
    selection: str = setting(
        'time',
        'Choice of samples where max_samples drops some: evenly in time, or those that cover '
        'positions, velocities and accelerations best.',
        choices=('time', 'coverage'),
    )

    @property
    def cutoff(self) -> float:
        """The cut-off as a number [Hz]; ConfigError if it is still to be chosen."""
        if self.cutoff_hz < 0.0:
            raise ConfigError(
                'preprocessing.cutoff_hz must be 0 or more where samples are smoothed, not '
                f'{self.cutoff_hz:g}; load recordings with load_dataset, which chooses it for -1.'
            )
        return self.cutoff_hz


@dataclass(frozen=True)
class FitSettings(Settings):
    """The model and its training."""

    kernel: str = setting(
        'articulated',
        'The model: an arm of rigid links with friction, whose joints are located by the fit, '
        'with a Gaussian process for the residual where it helps (articulated), or a kernel on '
        'energies alone, to which the settings below apply, all but terms and seed.',
        choices=('articulated', 'lip', 'recursive'),
    )
    terms: str = setting(
        'processes',
        'What may be beside the links of an arm where left-out motion asks for it: friction of '
        'forms in the literature alone (friction); also memory, and curves over the position or '
        'the velocity of a joint (named); also Gaussian processes, which no exported file has '
        '(processes).',
        choices=('processes', 'named', 'friction'),
    )
    friction: bool = setting(True, 'Add friction per joint, linear in dq and sign(dq).')
    subset: int = setting(
        250, 'Samples for the fit of hyperparameters, well spread over the data.', minimum=1
    )
    max_samples: int = setting(1000, 'Samples of the posterior.', minimum=1)
    iterations: int = setting(40, 'Most iterations of the optimiser.', minimum=0)
    prior_precision: float = setting(
        0.05, 'Precision of the prior on log hyperparameters; 0 for none.', minimum=0.0
    )
    seed: int = setting(0, 'Seed of every random choice.', minimum=0)
    coupling: tuple[str, ...] = setting(
        (),
        'Reported positions that are not those of a serial chain, each as "joint ratio '
        'other_joint": the joint moves by its position plus the ratio times that of the other '
        'joint, as "joint_3 -1 joint_2" of a parallelogram. Empty: they are searched for where no '
        'description is given; "none": there are none.',
    )
    description: str = setting(
        '',
        'URDF of the arm, a file or its text, as the prior of an articulated fit: the placements '
        'of the joints start there, and the model keeps its frames. Empty: placements are '
        'searched for.',
    )
    description_angle_deg: float = setting(
        0.5,
        'Standard deviation of the directions of the axes in the description [degrees]; 0 fixes '
        'all placements.',
        minimum=0.0,
    )
    description_distance_m: float = setting(
        0.002,
        'Standard deviation of the positions of the axes in the description [m]; 0 fixes all '
        'placements.',
        minimum=0.0,
    )
    description_inertial: float = setting(
        0.5,
        'Standard deviation of the inertials in the description, as a share of themselves.',
        minimum=0.01,
    )


@dataclass(frozen=True)
class Config:
    """All settings of a fit, by section."""

    recording: RecordingSettings = field(default_factory=RecordingSettings)
    preprocessing: PreprocessingSettings = field(default_factory=PreprocessingSettings)
    fit: FitSettings = field(default_factory=FitSettings)

    def __post_init__(self) -> None:
        """Refuse sections of another type with a ConfigError."""
        for section in fields(self):
            given, wanted = type(getattr(self, section.name)).__name__, section.type
            if given != wanted:
                raise ConfigError(
                    f'Config.{section.name} must be {wanted}, not {given}; write '
                    f'{wanted}(name=value).'
                )
