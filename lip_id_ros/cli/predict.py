"""Predict torques and energies along a recording."""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'predict torques and energies along a recording'
EPILOG = """\
example:
  lip_id predict arm.npz other_bag -o torques.npz    torques and their parts, energies, their
                                                     standard deviations

The recording is preprocessed with the settings of the fit, or with those of --config.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_model(parser)
    parser.add_argument(
        'source', type=arguments.source, metavar='SOURCE', help=arguments.SOURCE_HELP
    )
    arguments.add_output(parser, 'OUT.npz', 'file to write')
    arguments.add_config(parser, "the settings of the model's fit")
    arguments.add_force(parser)


def run(args: argparse.Namespace) -> None:
    """Predict and write."""
    from lip_id_ros.cli import models, output
    from lip_id_ros.evaluation import run as predict
    from lip_id_ros.evaluation.prediction import is_prediction, predicted_values, write_prediction
    from lip_id_ros.evaluation.tables import show_lines
    from lip_id_ros.files import require_suffix

    require_suffix(args.output, '.npz', 'the prediction')
    inputs = [args.model, args.source]
    output.check_file(args.output, inputs, is_prediction, 'a prediction', args.force)
    model = models.load(args.model)
    with output.progress_display() as progress:
        dataset = models.load_for(model, [args.source], args.config, progress)
        outcome = predict(model, dataset, progress)
        write_prediction(args.output, dataset, predicted_values(model, outcome, progress))
    text = f'Written: {args.output}, {dataset.n_samples} samples'
    show_lines([text], output.console())
