"""Read recordings, filter and differentiate them, and write one data set."""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'turn recordings into one data set'
EPILOG = """\
example:
  lip_id dataset my_bag -o data.npz --config arm.yaml

The data set holds t, q, dq, ddq, tau, joint_names, joint_types and segment; numpy.load reads it.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_sources(parser)
    arguments.add_output(parser, 'DATA.npz', 'file to write')
    arguments.add_config(parser, 'default settings')
    arguments.add_joints(parser)
    arguments.add_force(parser)


def run(args: argparse.Namespace) -> None:
    """Preprocess and save."""
    from lip_id_ros.cli import models, output, show
    from lip_id_ros.dataset import DATASET_SUFFIX
    from lip_id_ros.dataset.formats import is_data_set
    from lip_id_ros.evaluation import data_remarks
    from lip_id_ros.evaluation.tables import show_lines
    from lip_id_ros.files import require_suffix
    from lip_id_ros.loading.examined import load_dataset

    require_suffix(args.output, DATASET_SUFFIX, 'the data set')
    output.check_file(args.output, args.sources, is_data_set, 'a data set', args.force)
    config = models.chosen_config(args.config, {'recording.joints': args.joints})
    with output.progress_display() as progress:
        dataset = load_dataset(args.sources, config, progress)
        dataset.save(args.output)
    console = output.console()
    show.prepared(dataset, console)
    show_lines([*data_remarks(dataset.provenance), f'Written: {args.output}'], console)
