"""The settings of a fit, from the recording to the hyperparameters."""

from __future__ import annotations

from dataclasses import dataclass, field

from lip_id_ros.settings.settings import setting, Settings


@dataclass(frozen=True)
class RecordingSettings(Settings):
    """What is read from a recording, and what its numbers mean."""

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
        'Which stamps tell the time in bags; auto for those of the headers where they advance, '
        'else those of reception.',
        choices=('auto', 'header', 'receive'),
    )
    joint_types: tuple[str, ...] = setting(
        (), 'Type of each joint; empty for all revolute.', choices=('revolute', 'prismatic')
    )
    effort_scale: tuple[float, ...] = setting(
        (),
        'Factor from recorded effort to torque or force, per joint (motor constant times gear '
        'ratio where a current is recorded, negative to turn the sign); empty for 1.',
        unit='N m or N per unit of effort',
    )
    effort_offset: tuple[float, ...] = setting(
        (), 'Added to the scaled effort, per joint; empty for 0.', unit='N m or N'
    )
    gravity_compensated: bool = setting(
        False, 'The recorded effort leaves gravity out, so no potential energy can be learned.'
    )


@dataclass(frozen=True)
class PreprocessingSettings(Settings):
    """How raw samples become a data set."""

    cutoff_hz: float = setting(
        4.0,
        'Cut-off of the zero-phase low-pass on positions, velocities and torques; 0, or half the '
        'sampling rate and above, for none.',
        unit='Hz',
        minimum=0.0,
    )
    velocity: str = setting(
        'recorded',
        'Velocities as recorded, where they were, or the derivative of the positions.',
        choices=('recorded', 'differentiated'),
    )
    derivative: str = setting(
        'savitzky_golay',
        'How smooth samples are differentiated: five-point polynomials, or differences of the two '
        'neighbours.',
        choices=('savitzky_golay', 'central_differences'),
    )
    edge_periods: float = setting(
        1.0,
        'So many periods of the cut-off are left out at each end of a segment, where the low-pass '
        'knows only one side.',
        minimum=0.0,
    )
    max_gap_s: float = setting(
        0.0,
        'A longer step between samples begins a new segment; 0 for five times the median step.',
        unit='s',
        minimum=0.0,
    )
    min_segment_s: float = setting(
        1.0, 'Shorter segments are dropped and counted.', unit='s', minimum=0.0
    )
    decimate: int = setting(
        0,
        'Keep every k-th sample; 0 for about four in each period of the cut-off, since the '
        'low-pass leaves nothing new in between.',
        minimum=0,
    )
    min_velocity: float = setting(
        0.05,
        'Fit without the samples at which a joint is slower than this share of its root mean '
        'square velocity, where friction has no sign; all are kept where a quarter would not be '
        'left; 0 for none.',
        minimum=0.0,
    )
    max_samples: int = setting(0, 'Keep at most this many samples; 0 for all.', minimum=0)
    selection: str = setting(
        'time',
        'Which samples are kept where max_samples leaves some out: evenly in time, or those that '
        'cover positions, velocities and accelerations best.',
        choices=('time', 'coverage'),
    )


@dataclass(frozen=True)
class FitSettings(Settings):
    """The model and its training."""

    kernel: str = setting(
        'articulated',
        'A kernel on energies; articulated finds the places of the joints first, and adds the '
        'recursive kernel where rigid links leave something over.',
        choices=('articulated', 'lip', 'recursive', 'recursive_per_link'),
    )
    potential: str = setting(
        'kernel',
        'Potential energy: one product over all joints, one for every link, or as the kernel has '
        'it (lip the product, the others one for every link).',
        choices=('kernel', 'product', 'per_link'),
    )
    friction: bool = setting(True, 'Add friction per joint, linear in dq and sign(dq).')
    residual: bool = setting(
        False,
        'Add a squared-exponential term per joint for what the rest leaves over: fits the '
        'recorded motion more closely, and foreign motions worse.',
    )
    subset: int = setting(
        250, 'Samples that hyperparameters are fitted on, well spread over the data.', minimum=1
    )
    max_samples: int = setting(1000, 'Samples that the posterior is conditioned on.', minimum=1)
    iterations: int = setting(40, 'Most iterations of the optimiser.', minimum=0)
    prior_precision: float = setting(
        0.05, 'Precision of the prior on log hyperparameters; 0 for none.', minimum=0.0
    )
    device: str = setting(
        'cpu',
        'Where hyperparameters are fitted; cuda needs torch, and is the CPU where that finds no '
        'device.',
        choices=('cpu', 'cuda'),
    )
    seed: int = setting(0, 'Seed of every random choice.', minimum=0)


@dataclass(frozen=True)
class Config:
    """All settings of a fit, by section."""

    recording: RecordingSettings = field(default_factory=RecordingSettings)
    preprocessing: PreprocessingSettings = field(default_factory=PreprocessingSettings)
    fit: FitSettings = field(default_factory=FitSettings)
