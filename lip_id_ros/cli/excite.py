"""Design a motion from which an arm is learned well, within limits that hold at every time."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from lip_id_ros.cli import arguments

if TYPE_CHECKING:
    from lip_id_ros.evaluation.tables import Table
    from lip_id_ros.excitation.planning import ExcitingMotion

HELP = 'design a motion that teaches'
EPILOG = """\
examples:
  lip_id excite --urdf arm.urdf -o motion.yaml            a JointTrajectory, within 0.9 of the
                                                          limits of the URDF
  lip_id excite --config excite.yaml -o motion.yaml -o motion.csv -o motion.mcap
                                                          limits and posture from a file

The motion starts and ends at rest at the posture. Try it in simulation, and watch its first run
with a hand at the emergency stop: walls and the arm's own links are not known.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        '-o',
        '--output',
        action='append',
        required=True,
        metavar='OUT',
        help='file to write: .yaml or .mcap (JointTrajectory), or .csv; give it again for more',
    )
    parser.add_argument(
        '--urdf',
        type=arguments.source,
        metavar='FILE',
        help='robot description: joints and limits that the settings leave out',
    )
    parser.add_argument(
        '--config',
        type=arguments.source,
        metavar='FILE',
        help='settings in YAML, see config/excite.yaml (default settings)',
    )
    arguments.add_joints(parser)
    arguments.add_seed(parser)
    arguments.add_force(parser)


def run(args: argparse.Namespace) -> None:
    """Design, write and show."""
    from lip_id_ros.cli import output
    from lip_id_ros.evaluation.tables import show, show_lines
    from lip_id_ros.excitation.planning import design_motion
    from lip_id_ros.excitation.settings import ExcitationConfig
    from lip_id_ros.excitation.trajectory_file import is_motion, writer_for
    from lip_id_ros.settings import override, read_sections

    inputs = [*filter(None, [args.urdf, args.config])]
    output.check_distinct(*args.output)
    for path in args.output:
        output.check_file(path, inputs, is_motion, 'a motion', args.force)
        writer_for(path)
    config = ExcitationConfig()
    if args.config is not None:
        config = read_sections(args.config, config)
    chosen = {'motion.joints': args.joints, 'search.seed': args.seed}
    given = {name: value for name, value in chosen.items() if value is not None}
    config = override(config, given, 'the command line')
    with output.progress_display() as progress:
        found = design_motion(config, args.urdf, progress)
    console = output.console()
    show(motion_table(found), console)
    show_lines(gain_lines(found), console)
    for path in args.output:
        found.save(path)
    show_lines([f'Written: {path}' for path in args.output], console)


def motion_table(found: ExcitingMotion) -> Table:
    """Return what each joint does, and how much of its limits it uses at most."""
    from lip_id_ros.evaluation.tables import Table
    from lip_id_ros.joint_types import POSITION_UNITS

    ends = found.position_ends
    header = ('', 'posture', 'from', 'to', 'velocity', 'acceleration', 'jerk')
    rows = []
    for j, (name, kind) in enumerate(zip(found.joint_names, found.joint_types, strict=True)):
        places = (found.motion.posture[j], ends[0, j], ends[1, j])
        of_limits = (
            f'{peak:.3g} of {limit:.3g}'
            for peak, limit in zip(
                found.peaks[1:, j], (each[j] for each in found.limits.derivatives), strict=True
            )
        )
        rows.append(
            (f'{name} [{POSITION_UNITS[kind]}]', *(f'{q:.3f}' for q in places), *of_limits)
        )
    title = f'Motion of {found.motion.duration:g} s, with the largest values beside their limits'
    return Table(title, header, rows)


def gain_lines(found: ExcitingMotion) -> list[str]:
    """Return sentences on the expected error beside random motions."""
    to_mean, to_best = found.gains
    return [
        f'Expected squared error of torques after it: {to_mean:.2f} of that after random motions '
        f'within the same limits, {to_best:.2f} of that after the best of '
        f'{len(found.design.random_criteria)}.'
    ]
