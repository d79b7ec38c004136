"""Write a model's torques and energies along a recording."""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'write torques and energies along a recording'
EPILOG = """\
examples:
  lip_id predict arm.npz other_bag -o torques.npz    torques and their parts, energies, their
                                                     standard deviations
  lip_id predict arm.npz other_bag -o torques.mcap   topics /measured, /predicted and more, for
                                                     PlotJuggler and Foxglove

The recording is prepared as it was for the fit, unless --config says otherwise.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_model(parser)
    parser.add_argument('source', metavar='SOURCE', help=arguments.SOURCE_HELP)
    parser.add_argument(
        '-o', '--output', required=True, metavar='OUT', help='file to write: .npz or .mcap'
    )
    arguments.add_config(parser, "the settings of the model's fit")


def run(args: argparse.Namespace) -> None:
    """Predict and write."""
    from lip_id_ros.cli import models, output, settings, show
    from lip_id_ros.cli.progress_display import progress_display
    from lip_id_ros.evaluation import matched
    from lip_id_ros.evaluation.prediction_file import writer_for
    from lip_id_ros.preprocessing import load_dataset

    output.require_folder(args.output)
    write = writer_for(args.output)
    model = models.load(args.model)
    config = settings.of_model(model, args.config)
    with progress_display() as progress:
        dataset = matched(load_dataset([args.source], config, progress), model)
        write(args.output, dataset, model.values(dataset, progress))
    show.sentences([f'Written: {args.output}, {dataset.n_samples} samples'], output.console())
