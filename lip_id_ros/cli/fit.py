"""Learn a model from recordings and write it to one file."""

from __future__ import annotations

import argparse
import shlex

from lip_id_ros.cli import arguments, fleet

HELP = 'learn a model from recordings'
EPILOG = """\
examples:
  lip_id fit my_bag -o arm.npz
  lip_id fit run1.mcap run2.mcap -o arm.npz --config arm.yaml
  lip_id fit my_bag -o arm.npz --urdf arm.urdf  placements and links near those of the URDF, and
                                               a warning where the data contradict it
  lip_id fit my_bag -o arm.npz --holdout 0.3   fit without the last 30 % of the samples, and
                                               evaluate the model on them
  lip_id fit 'bags/**/*.mcap' s3://bucket/arm7/ -o arm.npz --engine ray --group-by '(robot\\d+)'
                                               several recordings, each read by itself
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_sources(parser)
    arguments.add_output(parser, 'MODEL.npz', 'file to write; - for standard output')
    arguments.add_config(parser, 'default settings')
    parser.add_argument(
        '--kernel',
        choices=('articulated', 'recursive', 'lip'),
        help='the model of the torques (default: articulated)',
    )
    parser.add_argument(
        '--urdf',
        type=arguments.source,
        metavar='FILE',
        help='robot description: the prior of the default model',
    )
    arguments.add_joints(parser)
    arguments.add_seed(parser)
    parser.add_argument(
        '--holdout',
        type=arguments.share,
        metavar='SHARE',
        help='leave the last share of the samples out of the fit and evaluate the model on them',
    )
    arguments.add_force(parser)
    fleet.add_arguments(parser)


def run(args: argparse.Namespace) -> None:
    """Fit, save and show."""
    from lip_id_ros.checked_file import is_model
    from lip_id_ros.cli import models, output, show
    from lip_id_ros.errors import LipIdError
    from lip_id_ros.evaluation.tables import show_lines
    from lip_id_ros.files import write_or_rescue
    from lip_id_ros.workflow.fit import learn_from, Learned

    several = fleet.is_asked(args)
    inputs = [*args.sources, *filter(None, [args.urdf, args.config])]
    if several:
        fleet.check(args, inputs)
    output.check_file(args.output, inputs, is_model, 'a model', args.force)
    config = models.fit_config(args)
    origin, remarks = '', list[str]()
    with output.progress_display() as progress:
        if several:
            result = fleet.learn(args, config, progress)
            learned = Learned(result.model, result.evaluation)
            origin, remarks = fleet.origin(result), fleet.others(result)
        else:
            learned = learn_from(args.sources, config, args.holdout or 0.0, progress)
        rescue = write_or_rescue(output.destination(args.output), learned.model.save)
    console = output.console(args.output, args.report)
    show.fitted(learned.model, console, origin)
    if learned.evaluation is not None:
        title = f'Held out: the last {100 * args.holdout:g} % of the samples'
        show.evaluated(learned.evaluation, title, console)
        if not several:
            where = shlex.join(['lip_id', 'evaluate', args.output, *args.sources])
            show_lines([f'Plots: {where} --last {args.holdout:g} --report DIR'], console)
    show_lines([*remarks, *learned.cautions], console)
    if several:
        show_lines(fleet.write_report(args, result), console)
    if learned.evaluation is None:
        show_lines([show.UNSEEN], console)
    if rescue is not None:
        raise LipIdError(rescue)
    show_lines([f'Written: {args.output}'], console)
