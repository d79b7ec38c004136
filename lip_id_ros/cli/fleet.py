"""`lip_id fit` for a fleet: many recordings, from disk or a store, by processes or Ray."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from lip_id_ros.cli import arguments
from lip_id_ros.errors import ConfigError

if TYPE_CHECKING:
    from lip_id_ros.fleet.engines import Engine
    from lip_id_ros.fleet.results import FleetResult
    from lip_id_ros.progress import Progress
    from lip_id_ros.settings import Config

LOCAL, RAY = 'local', 'ray'
OPTIONS = ('engine', 'address', 'jobs', 'group_by', 'cache', 'report')
JOBS_PER_PROCESSOR = 8
MOST_LISTED = 20
"""Recordings that are listed with their reasons; the report has all."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of a fit to a fleet."""
    fleet = parser.add_argument_group(
        'several recordings',
        'Any of these fits recording by recording, each with friction of its own. SOURCE may '
        "then be a pattern ('bags/**/*.mcap'), a folder of recordings or a URL that fsspec knows "
        '(s3://bucket/arm7/); docs/reference/fleet.md',
    )
    fleet.add_argument(
        '--engine',
        choices=(LOCAL, RAY),
        help='processes on this machine, or tasks of a Ray cluster (default: local)',
    )
    fleet.add_argument(
        '--address', help='Ray cluster (default: one is started on this machine for the fit)'
    )
    fleet.add_argument(
        '--jobs',
        type=arguments.count,
        metavar='N',
        help='processes of the engine on this machine (default: 1, with ray one per processor)',
    )
    fleet.add_argument(
        '--group-by',
        metavar='G',
        help='which robot a recording is of: a regular expression with one group, searched for in '
        'its address, or metadata:KEY of custom_data in metadata.yaml',
    )
    fleet.add_argument(
        '--cache',
        type=arguments.source,
        metavar='DIR',
        help='where results of recordings are kept for later fits (default: that of lip_id cache)',
    )
    fleet.add_argument('--report', metavar='PAGE.html', help='write a page about the recordings')


def is_asked(args: argparse.Namespace) -> bool:
    """Whether any argument of a fleet is given; ConfigError where a source needs one."""
    if any(getattr(args, name) is not None for name in OPTIONS):
        return True
    for source in map(str, args.sources):
        is_pattern = any(letter in source for letter in '*?[') and not os.path.exists(source)
        if '://' in source or is_pattern:
            raise ConfigError(
                f'a fit without --jobs or --engine needs files or folders, but {source} is a '
                'pattern or a URL; add --jobs 1, or name the recordings.'
            )
    return False


def check(args: argparse.Namespace, inputs: list[str]) -> None:
    """Refuse what belongs to the other engine, and a page in the place of something else."""
    from lip_id_ros.cli import output

    _check_engine(args)
    output.check_distinct(args.output, args.report)
    output.check_file(args.report, inputs, _is_report, 'a report', args.force)


def learn(args: argparse.Namespace, config: Config, progress: Progress) -> FleetResult:
    """Fit recording by recording, and judge by what is held out."""
    from lip_id_ros.fleet.cache import default_folder, FolderCache
    from lip_id_ros.fleet.fit import fit_fleet
    from lip_id_ros.fleet.sources import find

    sources = find(args.sources, args.group_by)
    cache = FolderCache(args.cache or default_folder())
    with _engine(args) as engine:
        return fit_fleet(sources, config, engine, cache, progress, args.holdout or 0.0)


def origin(result: FleetResult) -> str:
    """Return how many of the recordings are in the fit, for a title."""
    from lip_id_ros.fleet.results import FITTED

    n_fitted = sum(each.status == FITTED for each in result.recordings)
    return f'{n_fitted} of {len(result.recordings)} recordings, '


def others(result: FleetResult) -> list[str]:
    """Return a line for each recording that is not in the fit."""
    from lip_id_ros.fleet.results import FITTED

    left_out = [each for each in result.recordings if each.status != FITTED]
    lines = [f'{each.name} {each.status}: {each.reason}' for each in left_out[:MOST_LISTED]]
    if len(left_out) > MOST_LISTED:
        lines.append(f'{len(left_out) - MOST_LISTED} more are in the report (--report).')
    return lines


def write_report(args: argparse.Namespace, result: FleetResult) -> list[str]:
    """Write the page that is asked for; return a line about it."""
    if args.report is None:
        return []
    from lip_id_ros.cli import output
    from lip_id_ros.fleet.report import write_fleet_report  # brings matplotlib

    write_fleet_report(output.destination(args.report), result, Path(args.output).name)
    return [f'Report: {args.report}']


def _is_report(path: Path) -> bool:
    from lip_id_ros.fleet.report import is_report

    return is_report(path)


def _check_engine(args: argparse.Namespace) -> None:
    if args.address is not None and args.engine != RAY:
        raise ConfigError(
            '--address names a Ray cluster, but the engine is local; give --engine ray.'
        )
    if args.address is not None and args.jobs is not None:
        raise ConfigError(
            '--jobs is for engines on this machine, but --address names a cluster, which has its '
            'own number of workers; leave out one of them.'
        )

    most = JOBS_PER_PROCESSOR * (os.cpu_count() or 1)
    if args.jobs is not None and args.jobs > most:
        raise ConfigError(
            f'--jobs must be at most {most}, {JOBS_PER_PROCESSOR} for each processor of this '
            f'machine, not {args.jobs}; give a smaller number.'
        )


def _engine(args: argparse.Namespace) -> Engine:
    from lip_id_ros.fleet.engines import LocalEngine, RayEngine

    if args.engine == RAY:
        return RayEngine(args.address, args.jobs)
    return LocalEngine(args.jobs or 1)
