"""The program `lip_id`: parse arguments, run a verb, print an error as one line."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import io
import os
import sys

import lip_id_ros
from lip_id_ros.cli import (
    adapt,
    check_plan,
    dataset,
    demo,
    evaluate,
    excite,
    export,
    fit,
    inspect,
    payload,
    predict,
)
from lip_id_ros.errors import LipIdError, one_line

VERBS = (
    *(demo, excite, inspect, fit, evaluate, predict, adapt, check_plan, dataset, export),
    payload,
)
FAILED = 1
INTERRUPTED = 130  # as shells report a program ended by Ctrl-C
START = """\
lip_id learns a robot arm's inverse dynamics from recordings of its joints.

  lip_id demo                                  try it without a robot
  lip_id inspect my_bag                        what was recorded, and what is wrong with it
  lip_id fit my_bag -o arm.npz                 learn a model; add --urdf arm.urdf if you have one
  lip_id evaluate arm.npz other_bag --report out
  lip_id predict arm.npz other_bag -o torques.npz

`lip_id --help` lists all verbs, and `lip_id VERB --help` describes one.
eval "$(register-python-argcomplete lip_id)" completes verbs and options in bash.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run the command line.

    Returns 0, or 1 after one line on stderr with the error, or 130 after Ctrl-C; argparse exits
    with 2 for wrong usage, 0 for help. Without arguments it says how to begin.
    """
    _prepare_streams()
    parser = _parser()
    if '_ARGCOMPLETE' in os.environ:  # the shell asks what could come next
        import argcomplete

        argcomplete.autocomplete(parser)
    if not (sys.argv[1:] if argv is None else argv):
        print(START, end='')
        return 0
    arguments = parser.parse_args(argv)
    try:
        arguments.run(arguments)
        sys.stdout.flush()
    except KeyboardInterrupt:
        print('lip_id: interrupted', file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader closed the pipe, as in `lip_id ... | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except (LipIdError, OSError) as error:
        print(f'lip_id: error: {one_line(error)}', file=sys.stderr)
        return FAILED
    return 0


def _prepare_streams() -> None:
    """Replace closed streams, and escape what the encoding of the terminal lacks."""
    for name in ('stdout', 'stderr'):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, 'w'))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors='backslashreplace')


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='lip_id',
        description="Learn a robot arm's inverse dynamics from recordings, and use it.",
        epilog='`lip_id VERB --help` describes a verb.',
    )
    parser.add_argument('--version', action='version', version=f'lip_id {lip_id_ros.__version__}')
    verbs = parser.add_subparsers(title='verbs', metavar='VERB', required=True)
    for module in VERBS:
        verb = verbs.add_parser(
            module.__name__.rpartition('.')[2].replace('_', '-'),
            help=module.HELP,
            description=module.__doc__,
            epilog=module.EPILOG,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(verb)
        verb.set_defaults(run=module.run)
    return parser
