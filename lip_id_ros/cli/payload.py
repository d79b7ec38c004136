"""Identify the payload at the last link of an arm whose model is known."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from lip_id_ros.cli import arguments

if TYPE_CHECKING:
    from rich.console import Console

    from lip_id_ros.identification.payload import Payload

LONGEST_SHIFT = 10.0

HELP = 'find mass, centre of mass and inertia of a payload'
EPILOG = """\
examples:
  lip_id payload arm.npz with_gripper_bag              the payload on the terminal
  lip_id payload arm.npz with_gripper_bag --yaml gripper.yaml -o arm_with_gripper.npz

Some seconds of motion of the arm with its payload suffice; the model is of the arm without it. All
is given in the frame of the last link of `lip_id export`, or with --flange in the robot's flange.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_model(parser)
    arguments.add_sources(parser)
    parser.add_argument('-o', '--output', metavar='MODEL', help='write the model with the payload')
    parser.add_argument(
        '--yaml', metavar='FILE', help='write the payload, also as UR and Franka robots take it'
    )
    parser.add_argument(
        '--flange',
        type=flange,
        default=(0.0, 0.0),
        metavar='METRES,DEGREES',
        help="the flange's frame in that of the last link: shift along the last axis, turn about "
        'it (default: 0,0)',
    )
    arguments.add_config(parser, "the settings of the model's fit")
    arguments.add_force(parser)


def flange(text: str) -> tuple[float, float]:
    """Read a shift [m] and a turn [degrees]."""
    try:
        shift, turn = (float(part) for part in text.split(','))
    except ValueError:
        shift = turn = math.nan
    if not (abs(shift) <= LONGEST_SHIFT and abs(turn) <= 360.0):
        raise argparse.ArgumentTypeError(
            f'a shift of at most {LONGEST_SHIFT:g} m and a turn of at most 360 degrees with a '
            f'comma between them were expected, but {text!r} came'
        )
    return shift, turn


def run(args: argparse.Namespace) -> None:
    """Find the payload, show it, and write what is asked for."""
    from lip_id_ros.checked_file import is_model
    from lip_id_ros.cli import models, output
    from lip_id_ros.evaluation.tables import show_lines
    from lip_id_ros.export.payload import is_payload, require_links, to_yaml
    from lip_id_ros.files import write_whole
    from lip_id_ros.workflow.fit import find_payload

    inputs = [args.model, *args.sources]
    output.check_distinct(args.yaml, args.output)
    output.check_file(args.yaml, inputs, is_payload, 'a payload', args.force)
    output.check_file(args.output, inputs, is_model, 'a model', args.force)
    model = models.load(args.model)
    require_links(model, args.model)
    with output.progress_display() as progress:
        dataset = models.load_examined(model, args.sources, args.config, progress)
    found = find_payload(model, dataset, args.flange)
    console = output.console()
    _show(found.payload, console)
    show_lines(found.cautions, console)
    if args.yaml is not None:
        text = to_yaml(found.payload, args.sources, args.flange)
        write_whole(args.yaml, text.encode())
        show_lines([f'Written: {args.yaml}'], console)
    if args.output is not None:
        found.model.save(args.output)
        show_lines([f'Written: {args.output}'], console)


def _show(payload: Payload, console: Console) -> None:
    from lip_id_ros.evaluation.tables import show, Table
    from lip_id_ros.export.payload import inertias

    rows = [('mass', f'{payload.mass:.4f} kg', f'{payload.mass_std:.4f} kg')]
    for axis, value, std in zip('xyz', payload.centre, payload.centre_std, strict=True):
        rows.append((f'centre of mass, {axis}', f'{value:.4f} m', f'{std:.4f} m'))
    rows += [
        (f'inertia about it, {name}', f'{value:.5f} kg m^2', '')
        for name, value in inertias(payload).items()
    ]
    show(Table('payload', ('', '', 'standard deviation'), rows), console)
