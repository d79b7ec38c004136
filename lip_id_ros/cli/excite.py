"""Design a motion from which an arm is learned well, within limits that hold at every time."""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'design a motion that teaches'
EPILOG = """\
examples:
  lip_id excite --urdf arm.urdf -o motion.yaml            a JointTrajectory, within 0.3 of the
                                                          limits of the URDF
  lip_id excite --config excite.yaml -o motion.yaml -o motion.csv -o motion.mcap
                                                          limits and posture from a file
  lip_id excite --after arm.npz --urdf arm.urdf -o next.yaml
                                                          what the model does not know yet

The motion starts and ends at rest at the posture: move the arm there first. With a URDF the links
keep 5 cm from each other and from the plane that the arm stands on. Nothing else is kept clear of
but what the settings name in `space`: try the motion in simulation, and watch its first run with a
hand at the emergency stop.
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
        help='robot description: links, and joints and limits that the settings leave out',
    )
    parser.add_argument(
        '--config',
        type=arguments.source,
        metavar='FILE',
        help='settings in YAML, see config/excite.yaml (default settings)',
    )
    parser.add_argument(
        '--after',
        type=arguments.source,
        metavar='MODEL',
        help='model of what has been learned already: the motion teaches what is still unknown',
    )
    parser.add_argument(
        '--targets',
        type=arguments.source,
        metavar='SOURCE',
        help='recording of motions whose torques will be wanted of the model',
    )
    arguments.add_joints(parser, 'those that move in the URDF, or those of the model')
    arguments.add_seed(parser)
    parser.add_argument('--report', metavar='DIR', help='write plots and index.html')
    arguments.add_force(parser)


def run(args: argparse.Namespace) -> None:
    """Design, write and show."""
    from lip_id_ros.cli import models, output
    from lip_id_ros.errors import ConfigError
    from lip_id_ros.evaluation.tables import show, show_lines
    from lip_id_ros.excitation.motion_tables import learning_tables, motion_lines, motion_table
    from lip_id_ros.excitation.planning import design_motion
    from lip_id_ros.excitation.settings import ExcitationConfig
    from lip_id_ros.excitation.trajectory_file import is_motion, writer_for
    from lip_id_ros.settings import override, read_sections

    inputs = [*filter(None, [args.urdf, args.config, args.after, args.targets])]
    if args.targets is not None and args.after is None:
        raise ConfigError('--targets needs a model that the torques are wanted of; add --after.')
    output.check_distinct(*args.output)
    for path in args.output:
        output.check_file(path, inputs, is_motion, 'a motion', args.force)
        writer_for(path)
    output.check_folder(args.report, args.force)
    config = ExcitationConfig()
    if args.config is not None:
        config = read_sections(args.config, config)
    chosen = {'motion.joints': args.joints, 'search.seed': args.seed}
    given = {name: value for name, value in chosen.items() if value is not None}
    config = override(config, given, 'the command line')
    with output.progress_display() as progress:
        model = None if args.after is None else models.load(args.after)
        targets = None
        if model is not None and args.targets is not None:
            targets = models.load_for(model, [args.targets], None, progress)
        found = design_motion(config, args.urdf, model, targets, progress)
    console = output.console()
    for table in (motion_table(found), *learning_tables(found)):
        show(table, console)
    show_lines(motion_lines(found), console)
    for path in args.output:
        found.save(path)
    show_lines([f'Written: {path}' for path in args.output], console)
    if args.report is not None:
        from lip_id_ros.excitation.report import write_motion_report

        with output.progress_display() as progress:
            written = write_motion_report(args.report, found, progress)
        show_lines([f'Written: {written}'], console)
