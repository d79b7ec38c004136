"""Learn a model from recordings and write it to one file."""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'learn a model from recordings'
EPILOG = """\
examples:
  lip_id fit my_bag -o arm.npz
  lip_id fit run1.mcap run2.mcap -o arm.npz --config arm.yaml
  lip_id fit my_bag -o arm.npz --holdout 0.3   judge it on the last 30 % of the samples,
                                               which it has not seen
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_sources(parser)
    parser.add_argument('-o', '--output', required=True, metavar='MODEL.npz', help='file to write')
    arguments.add_config(parser, 'default settings')
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument(
        '--kernel',
        choices=('articulated', 'recursive', 'recursive_per_link', 'lip'),
        help='what torques are made of (default: articulated)',
    )
    kind.add_argument(
        '--model',
        choices=arguments.MODELS,
        metavar='NAME',
        help=f'a model of the literature instead: {", ".join(arguments.MODELS)}; '
        'for evaluate and predict, not for serve',
    )
    parser.add_argument(
        '--urdf', metavar='FILE', help='robot description, for models that need it'
    )
    arguments.add_joints(parser)
    parser.add_argument(
        '--device',
        choices=('cpu', 'cuda'),
        help='where to fit: cuda needs torch, and is the CPU where there is no device '
        '(default: cpu)',
    )
    parser.add_argument(
        '--seed', type=int, metavar='K', help='seed of every random choice (default: 0)'
    )
    parser.add_argument(
        '--holdout',
        type=arguments.share,
        metavar='SHARE',
        help='keep the last share of the samples out of the fit and evaluate on them',
    )


def run(args: argparse.Namespace) -> None:
    """Fit, save and show."""
    from lip_id_ros.cli import models, output, settings, show
    from lip_id_ros.cli.examination import Examination
    from lip_id_ros.cli.progress_display import progress_display
    from lip_id_ros.evaluation.health_text import notable
    from lip_id_ros.preprocessing import for_training, load_dataset

    output.require_folder(args.output)
    config = settings.for_fit(args)
    evaluation = None
    examination = Examination(config.recording)
    with progress_display() as progress:
        training = load_dataset(args.sources, config, progress, examination)
        if args.holdout is not None:
            training, held_out = training.split(1 - args.holdout)
        training = for_training(training, config.preprocessing)
        model = models.learn(args, training, config.fit, progress)
        if args.holdout is not None:
            evaluation = model.evaluate(held_out, progress)
        model.save(args.output)
    console = output.console()
    model.show(training, console)
    if evaluation is not None:
        title = f'Held out: the last {100 * args.holdout:g} % of the samples'
        show.evaluated(evaluation, title, console)
    show.sentences(notable(examination.found), console)
    honest = [] if evaluation is not None else [show.HONEST]
    show.sentences([*model.cautions(), *honest, f'Written: {args.output}'], console)
