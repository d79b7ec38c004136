"""Measure how long a model takes to predict on this machine."""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'measure how long a model takes to predict'
EPILOG = """\
example:
  lip_id bench arm.npz --json bench.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_model(parser)
    arguments.add_json(parser)
    arguments.add_force(parser)


def run(args: argparse.Namespace) -> None:
    """Measure and show."""
    from lip_id_ros.cli import output, show
    from lip_id_ros.evaluation.speed import measure
    from lip_id_ros.model import InverseDynamicsModel

    output.check_file(args.json, [args.model], output.is_json, 'a JSON object', args.force)
    model = InverseDynamicsModel.load(args.model)
    with output.progress_display() as progress:
        speed = measure(model, model.n_samples, progress)
    show.measured(speed, output.console(args.json))
    output.write_json(args.json, speed.to_json())
