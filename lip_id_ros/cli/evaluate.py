"""Compare a model's torques and energies with recordings."""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'compare a model with recordings: errors, energies, plots'
EPILOG = """\
examples:
  lip_id evaluate arm.npz other_bag
  lip_id evaluate arm.npz other_bag --report out    plots, and out/index.html with all of them
  lip_id evaluate arm.npz my_bag --last 0.3         the samples that fit --holdout 0.3 left out
  lip_id evaluate arm.npz other_bag --json -        figures for another program

Recordings are preprocessed with the settings of the fit, or with those of --config.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_model(parser)
    arguments.add_sources(parser)
    arguments.add_config(parser, "the settings of the model's fit")
    parser.add_argument(
        '--last',
        type=arguments.share,
        metavar='SHARE',
        help='evaluate the last share of the samples only',
    )
    arguments.add_json(parser)
    parser.add_argument('--report', metavar='DIR', help='write plots and a web page there')
    arguments.add_force(parser)


def run(args: argparse.Namespace) -> None:
    """Evaluate, show and write."""
    from lip_id_ros.cli import models, output, show
    from lip_id_ros.evaluation import evaluation_cautions, score
    from lip_id_ros.evaluation import run as predict
    from lip_id_ros.evaluation.cautions import copy_cautions
    from lip_id_ros.evaluation.report import band, Labels, write_report
    from lip_id_ros.evaluation.tables import show_lines

    inputs = [args.model, *args.sources]
    output.check_json(args.json, inputs, args.force)
    output.check_folder(args.report, args.force)
    model = models.load(args.model)
    sources = ', '.join(args.sources)
    with output.progress_display() as progress:
        dataset = models.load_for(model, args.sources, args.config, progress)
        if args.last is not None:
            _, dataset = dataset.split(1.0 - args.last)
            sources += f', the last {100 * args.last:g} %'
        outcome = predict(model, dataset, progress)
        evaluation = score(outcome)
        warnings = copy_cautions(dataset.provenance)
        if args.report:
            facts = (
                ('model', args.model),
                ('recordings', sources),
                ('kernel', model.kernel),
                ('samples in the model', str(model.n_samples)),
            )
            labels = Labels('Inverse dynamics: model against measurement', warnings, facts)
            uncertainty = band(model, outcome, progress)
            page = write_report(args.report, outcome, evaluation, uncertainty, labels, progress)
    console = output.console(args.json)
    show.evaluated(evaluation, f'{args.model} on {sources}', console)
    show_lines([*evaluation_cautions(evaluation), *warnings], console)
    if args.report:
        show_lines([f'Written: {page}'], console)
    output.write_json(args.json, evaluation.to_json())
