"""Show or prune what fits of fleets keep for later fits."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lip_id_ros.fleet.cache import Entry

from lip_id_ros.cli import arguments
from lip_id_ros.errors import ConfigError

HELP = 'show or prune what fits of several recordings keep'
EPILOG = """\
examples:
  lip_id cache                            how many results are kept, and where
  lip_id cache --prune outdated           remove results of other versions of the code
  lip_id cache --prune refused            try recordings again that could not be used
  lip_id cache --prune all --unused-days 30   remove what no fit used for a month
"""
OUTDATED, REFUSED, ALL = 'outdated', 'refused', 'all'


REFUSAL = 'refusal'
KINDS = {
    'surveys': 'survey',
    'placements': 'placements',
    'statistics': 'statistics',
    'selected preprocessing': 'preprocessing',
    'recordings that cannot be used': REFUSAL,
}
"""Results of this version of the code, as they are shown, by their kind."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        '--cache',
        type=arguments.source,
        metavar='DIR',
        help='folder (default: lip_id_ros/fleet in $XDG_CACHE_HOME or ~/.cache)',
    )
    parser.add_argument(
        '--prune',
        choices=(OUTDATED, REFUSED, ALL),
        help='remove results: those of other versions, refusals of recordings, or all',
    )
    parser.add_argument(
        '--unused-days',
        type=arguments.days,
        metavar='D',
        help='with --prune: only results that no fit used for so many days',
    )


def run(args: argparse.Namespace) -> None:
    """Show what is kept, and remove what is asked for."""
    from lip_id_ros.cli import output
    from lip_id_ros.evaluation.tables import show, show_lines, Table
    from lip_id_ros.fleet import cache

    if args.unused_days is not None and args.prune is None:
        raise ConfigError('--unused-days limits --prune, which is missing; add it.')
    folder = args.cache or cache.default_folder()
    console = output.console()
    entries = list(cache.entries(folder))
    if args.prune is not None:
        some = [each for each in entries if _is_chosen(each, args.prune)]
        some = cache.unused_for(some, args.unused_days) if args.unused_days else some
        freed = cache.prune(some)
        show_lines([f'{len(some)} removed, {_megabytes(freed)} freed.'], console)
        entries = list(cache.entries(folder))
    current = [each for each in entries if each.is_current]
    kinds = {name: [each for each in current if each.kind == kind] for name, kind in KINDS.items()}
    others = {'other versions of the code': [each for each in entries if not each.is_current]}
    rows = [
        (name, str(len(those)), _megabytes(sum(each.size for each in those)))
        for name, those in (kinds | others).items()
    ]
    show(Table(str(folder), ('', 'results', 'size'), rows), console)


def _is_chosen(entry: Entry, choice: str) -> bool:
    if choice == REFUSED:
        return entry.kind == REFUSAL
    return choice == ALL or not entry.is_current


def _megabytes(size: float) -> str:
    return f'{size / 1e6:.3g} MB'
