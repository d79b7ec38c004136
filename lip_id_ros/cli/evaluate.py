"""Compare a model's torques and energies with recordings."""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'compare a model with recordings: errors, energies, plots'
EPILOG = """\
examples:
  lip_id evaluate arm.npz other_bag
  lip_id evaluate arm.npz other_bag --report out    plots, and out/index.html with all of them
  lip_id evaluate arm.npz other_bag --json -        figures for another program

Recordings are prepared as they were for the fit, unless --config says otherwise.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_model(parser)
    arguments.add_sources(parser)
    arguments.add_config(parser, "the settings of the model's fit")
    arguments.add_json(parser)
    parser.add_argument('--report', metavar='DIR', help='write plots and a web page there')


def run(args: argparse.Namespace) -> None:
    """Evaluate, show and write."""
    from lip_id_ros.cli import models, output, settings, show
    from lip_id_ros.cli.progress_display import progress_display
    from lip_id_ros.evaluation import matched
    from lip_id_ros.preprocessing import load_dataset

    output.require_folder(args.json)
    output.require_no_file(args.report)
    model = models.load(args.model)
    config = settings.of_model(model, args.config)
    with progress_display() as progress:
        dataset = matched(load_dataset(args.sources, config, progress), model)
        if args.report:
            evaluation = model.report(args, dataset, progress)
        else:
            evaluation = model.evaluate(dataset, progress)
    console = output.console(args.json)
    show.evaluated(evaluation, f'{args.model} on {", ".join(args.sources)}', console)
    show.sentences(model.warnings(dataset), console)
    output.write_json(args.json, evaluation.to_json())
