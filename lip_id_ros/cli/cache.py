"""Show or prune what fits of fleets keep for later fits."""

from __future__ import annotations

import argparse

HELP = 'show or prune what fits of fleets keep'
EPILOG = """\
examples:
  lip_id cache                            how many results are kept, and where
  lip_id cache --prune outdated           remove results of other versions of the code
  lip_id cache --prune all --unused-days 30   remove what no fit used for a month
"""
OUTDATED, ALL = 'outdated', 'all'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        '--cache',
        metavar='DIR',
        help='folder (default: lip_id_ros/fleet in $XDG_CACHE_HOME or ~/.cache)',
    )
    parser.add_argument(
        '--prune', choices=(OUTDATED, ALL), help='remove results: those of other versions, or all'
    )
    parser.add_argument(
        '--unused-days',
        type=float,
        default=0.0,
        metavar='D',
        help='with --prune: only results that no fit used for so many days',
    )


def run(args: argparse.Namespace) -> None:
    """Show what is kept, and remove what is asked for."""
    from lip_id_ros.cli import output
    from lip_id_ros.evaluation.tables import show, show_lines, Table
    from lip_id_ros.fleet import cache

    folder = args.cache or cache.default_folder()
    console = output.console()
    entries = list(cache.entries(folder))
    if args.prune is not None:
        some = [each for each in entries if args.prune == ALL or not each.is_current]
        some = cache.unused_for(some, args.unused_days) if args.unused_days else some
        freed = cache.prune(some)
        show_lines([f'{len(some)} results removed, {_megabytes(freed)} freed.'], console)
        entries = list(cache.entries(folder))
    rows = [
        (name, str(len(those)), _megabytes(sum(each.size for each in those)))
        for name, those in (
            ('this version of the code', [each for each in entries if each.is_current]),
            ('other versions', [each for each in entries if not each.is_current]),
        )
    ]
    show(Table(str(folder), ('', 'results', 'size'), rows), console)


def _megabytes(size: float) -> str:
    return f'{size / 1e6:.3g} MB'
