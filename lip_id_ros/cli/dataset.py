"""Read recordings, filter and differentiate them, and write one data set."""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'turn recordings into one data set'
EPILOG = """\
example:
  lip_id dataset my_bag -o data.npz --config arm.yaml
  lip_id dataset my_bag -o data.csv        for a spreadsheet; loses joint types and provenance

The data set holds t, q, dq, ddq, tau, joint_names, joint_types and segment; numpy.load reads it.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_sources(parser)
    parser.add_argument(
        '-o', '--output', required=True, metavar='DATA', help='file to write: .npz or .csv'
    )
    arguments.add_config(parser, 'default settings')
    arguments.add_joints(parser)


def run(args: argparse.Namespace) -> None:
    """Prepare and save."""
    from lip_id_ros.cli import output, settings, show
    from lip_id_ros.cli.progress_display import progress_display
    from lip_id_ros.dataset import check_suffix
    from lip_id_ros.preprocessing import load_dataset

    output.require_folder(args.output)
    check_suffix(args.output)
    config = settings.for_data(args)
    with progress_display() as progress:
        dataset = load_dataset(args.sources, config, progress)
        dataset.save(args.output)
    console = output.console()
    show.prepared(dataset, console)
    show.sentences([f'Written: {args.output}'], console)
