"""Arguments of several verbs; imports nothing heavy, so that --help is quick."""

from __future__ import annotations

import argparse
import math

SOURCE_HELP = 'rosbag2 folder, .mcap, .db3, ROS 1 .bag, .csv or data set .npz'


def add_sources(parser: argparse.ArgumentParser) -> None:
    """Add the recordings to read."""
    parser.add_argument('sources', nargs='+', type=source, metavar='SOURCE', help=SOURCE_HELP)


def add_model(parser: argparse.ArgumentParser) -> None:
    """Add the model to use."""
    parser.add_argument(
        'model', type=source, metavar='MODEL', help='model file, as `lip_id fit` writes it'
    )


def add_config(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the settings file; `default` names the settings without one."""
    parser.add_argument(
        '--config',
        type=source,
        metavar='FILE',
        help=f'settings in YAML, see docs/reference/interfaces.md ({default})',
    )


def add_joints(
    parser: argparse.ArgumentParser, default: str = 'all, in the order of the recording'
) -> None:
    """Add the choice of joints; `default` names those that are taken without it."""
    parser.add_argument(
        '--joints',
        type=joint_names,
        metavar='A,B,...',
        help=f'joints by name, from base to tip (default: {default})',
    )


def add_output(parser: argparse.ArgumentParser, metavar: str, what: str) -> None:
    """Add the file or folder to write."""
    parser.add_argument('-o', '--output', required=True, metavar=metavar, help=what)


def add_seed(parser: argparse.ArgumentParser) -> None:
    """Add the seed."""
    parser.add_argument(
        '--seed', type=int, metavar='K', help='seed of every random choice (default: 0)'
    )


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add the file for machine-readable figures."""
    parser.add_argument(
        '--json', metavar='FILE', help='write the figures as JSON; - for standard output'
    )


def add_force(parser: argparse.ArgumentParser) -> None:
    """Add the permission to replace any file."""
    parser.add_argument(
        '--force',
        action='store_true',
        help='replace the output even where it is an input, or a file or folder of another kind',
    )


def source(text: str) -> str:
    """Return the path of a source, which must not be empty (the current folder)."""
    if not text:
        raise argparse.ArgumentTypeError('expected a path, got an empty text')
    return text


def joint_names(text: str) -> tuple[str, ...]:
    """Split joint names at commas; argparse.ArgumentTypeError, as below, if one is empty."""
    names = tuple(name.strip() for name in text.split(','))
    if not all(names):
        raise argparse.ArgumentTypeError(f'expected names separated by commas, got {text!r}')
    return names


def count(text: str) -> int:
    """Read a whole number above zero."""
    if not text.isascii() or not text.isdigit() or int(text) == 0:
        raise argparse.ArgumentTypeError(f'expected a whole number above 0, got {text!r}')
    return int(text)


def seconds(text: str) -> float:
    """Read a number of seconds, zero or more; argparse.ArgumentTypeError if not."""
    return _not_negative(text, 'seconds')


def standard_deviations(text: str) -> float:
    """Read a number of standard deviations, zero or more; argparse.ArgumentTypeError if not."""
    return _not_negative(text, 'standard deviations')


def _not_negative(text: str, unit: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f'expected a number of {unit}, 0 or more, got {text!r}')
    return value


def share(text: str) -> float:
    """Read a share between 0 and 1, both excluded."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < 1:
        raise argparse.ArgumentTypeError(f'expected a share between 0 and 1, got {text!r}')
    return value
