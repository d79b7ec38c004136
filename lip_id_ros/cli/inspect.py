"""Say what is in a recording, a data set or a model."""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'say what is in a recording, a data set or a model'
EPILOG = """\
examples:
  lip_id inspect my_bag                  what was recorded, and what is wrong with it
  lip_id inspect my_bag --report out     plots, and out/index.html with all of them
  lip_id inspect arm.npz --json -
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument('file', metavar='FILE', help=f'{arguments.SOURCE_HELP}, or model .npz')
    arguments.add_json(parser)
    parser.add_argument(
        '--report', metavar='DIR', help='write plots of a recording and a web page there'
    )


def run(args: argparse.Namespace) -> None:
    """Describe and show."""
    from lip_id_ros.cli import outline, output
    from lip_id_ros.cli.description import describe_file
    from lip_id_ros.cli.examination import Examination
    from lip_id_ros.cli.progress_display import progress_display

    output.require_folder(args.json)
    output.require_no_file(args.report)
    examination = Examination()
    with progress_display() as progress:
        description = describe_file(args.file, progress, examination)
        if args.report:
            examination.report(args.report, args.file, progress)
    outline.described(description, output.console(args.json))
    output.write_json(args.json, description)
