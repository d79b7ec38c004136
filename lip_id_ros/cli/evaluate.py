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

Recordings are preprocessed with the settings of the fit, or with those of --config.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_model(parser)
    arguments.add_sources(parser)
    arguments.add_config(parser, "the settings of the model's fit")
    arguments.add_json(parser)
    parser.add_argument('--report', metavar='DIR', help='write plots and a web page there')
    arguments.add_force(parser)


def run(args: argparse.Namespace) -> None:
    """Evaluate, show and write."""
    from lip_id_ros.cli import models, output, show
    from lip_id_ros.evaluation import run as predict
    from lip_id_ros.evaluation import score
    from lip_id_ros.evaluation.cautions import copy_cautions, training_data_warnings
    from lip_id_ros.evaluation.report import band, Labels, write_report
    from lip_id_ros.evaluation.tables import show_lines

    inputs = [args.model, *args.sources]
    output.check_file(args.json, inputs, output.is_json, 'a JSON object', args.force)
    output.check_folder(args.report, args.force)
    model = models.load(args.model)
    sources = ', '.join(args.sources)
    with output.progress_display() as progress:
        dataset = models.load_for(model, args.sources, args.config, progress)
        warnings = training_data_warnings(model, dataset) + copy_cautions(dataset.provenance)
        outcome = predict(model, dataset, progress)
        evaluation = score(outcome)
        if args.report:
            facts = (('model', args.model), ('recordings', sources), *models.facts(model))
            labels = Labels('Inverse dynamics: model against measurement', warnings, facts)
            uncertainty = band(model, outcome, progress)
            write_report(args.report, outcome, evaluation, uncertainty, labels, progress)
    console = output.console(args.json)
    show.evaluated(evaluation, f'{args.model} on {sources}', console)
    show_lines(warnings, console)
    output.write_json(args.json, evaluation.to_json())
