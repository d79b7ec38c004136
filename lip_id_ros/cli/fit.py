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
    parser.add_argument(
        '--kernel',
        choices=('recursive', 'recursive_per_link', 'nested', 'lip'),
        help='energy kernel (default: recursive)',
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
    from lip_id_ros.cli import output, settings, show
    from lip_id_ros.cli.examination import Examination
    from lip_id_ros.cli.progress_display import progress_display
    from lip_id_ros.evaluation import evaluate, with_inertia_check
    from lip_id_ros.evaluation.health_text import notable
    from lip_id_ros.gp import fit
    from lip_id_ros.preprocessing import for_training, load_dataset
    from lip_id_ros.serving import Predictor

    output.require_folder(args.output)
    config = settings.for_fit(args)
    evaluation = None
    examination = Examination(config.recording)
    with progress_display() as progress:
        training = load_dataset(args.sources, config, progress, examination)
        if args.holdout is not None:
            training, held_out = training.split(1 - args.holdout)
        training = for_training(training, config.preprocessing)
        model = with_inertia_check(fit(training, config.fit, progress))
        if args.holdout is not None:
            evaluation = evaluate(Predictor(model), held_out, progress)
        model.save(args.output)
    console = output.console()
    show.fitted(model, training, console)
    if evaluation is not None:
        title = f'Held out: the last {100 * args.holdout:g} % of the samples'
        show.evaluated(evaluation, title, console)
    show.sentences(notable(examination.found), console)
    show.sentences([*show.cautions(model, evaluation), f'Written: {args.output}'], console)
