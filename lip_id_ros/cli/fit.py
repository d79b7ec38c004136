"""Learn a model from recordings and write it to one file."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import shlex
from typing import TYPE_CHECKING

from lip_id_ros.cli import arguments
from lip_id_ros.errors import ConfigError

if TYPE_CHECKING:
    from lip_id_ros.fleet.engines import Engine
    from lip_id_ros.fleet.results import FleetResult
    from lip_id_ros.progress import Progress
    from lip_id_ros.settings import Config

HELP = 'learn a model from recordings'
EPILOG = """\
examples:
  lip_id fit my_bag -o arm.npz
  lip_id fit run1.mcap run2.mcap -o arm.npz --config arm.yaml
  lip_id fit my_bag -o arm.npz --urdf arm.urdf  placements and links near those of the URDF, and
                                               a warning where the data contradict it
  lip_id fit my_bag -o arm.npz --holdout 0.3   fit without the last 30 % of the samples, and
                                               evaluate the model on them
  lip_id fit 'bags/**/*.mcap' s3://bucket/arm7/ -o arm.npz --engine ray --group-by '(robot\\d+)'
                                               several recordings, each read by itself
"""
LOCAL, RAY = 'local', 'ray'
OPTIONS = ('engine', 'address', 'jobs', 'group_by', 'cache', 'report')
JOBS_PER_PROCESSOR = 8
MOST_LISTED = 20
"""Recordings that are listed with their reasons; the report has all."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_sources(parser)
    arguments.add_output(parser, 'MODEL.npz', 'file to write')
    arguments.add_config(parser, 'default settings')
    parser.add_argument(
        '--kernel',
        choices=('articulated', 'recursive', 'lip'),
        help='the model of the torques (default: articulated)',
    )
    parser.add_argument(
        '--urdf',
        type=arguments.source,
        metavar='FILE',
        help='robot description: the prior of the default model',
    )
    arguments.add_joints(parser)
    arguments.add_seed(parser)
    parser.add_argument(
        '--holdout',
        type=arguments.share,
        metavar='SHARE',
        help='leave the last share of the samples out of the fit and evaluate the model on them',
    )
    arguments.add_force(parser)
    _add_arguments_of_several(parser)


def run(args: argparse.Namespace) -> None:
    """Fit, save and show."""
    from lip_id_ros.checked_file import is_model
    from lip_id_ros.cli import models, output, show
    from lip_id_ros.description.urdf import parsed, urdf_text
    from lip_id_ros.evaluation.tables import show_lines
    from lip_id_ros.workflow.fit import learn_from, Learned

    several = _are_several(args)
    inputs = [*args.sources, *filter(None, [args.urdf, args.config])]
    if several:
        _check_several(args, inputs)
    output.check_file(args.output, inputs, is_model, 'a model', args.force)
    config = models.fit_config(args)
    if args.urdf is not None:
        parsed(*urdf_text(args.urdf))  # reading recordings may take minutes
    origin, remarks = '', list[str]()
    with output.progress_display() as progress:
        if several:
            result = _fit_each(args, config, progress)
            learned = Learned(result.model, result.evaluation)
            origin, remarks = _origin(result), _left_out(result)
        else:
            learned = learn_from(args.sources, config, args.holdout or 0.0, progress)
        learned.model.save(args.output)
    console = output.console()
    show.fitted(learned.model, console, origin)
    if learned.evaluation is not None:
        title = f'Held out: the last {100 * args.holdout:g} % of the samples'
        show.evaluated(learned.evaluation, title, console)
        if not several:
            where = shlex.join(['lip_id', 'evaluate', args.output, *args.sources])
            show_lines([f'Plots: {where} --last {args.holdout:g} --report DIR'], console)
    show_lines([*remarks, *learned.cautions], console)
    if several:
        show_lines(_write_report(args, result), console)
    if learned.evaluation is None:
        show_lines([show.UNSEEN], console)
    show_lines([f'Written: {args.output}'], console)


def _add_arguments_of_several(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of a fit to a fleet."""
    fleet = parser.add_argument_group(
        'several recordings',
        'Any of these fits recording by recording, each with friction of its own.\n'
        "SOURCE may then be a pattern ('bags/**/*.mcap'), a folder of recordings or\n"
        'a URL that fsspec knows (s3://bucket/arm7/); docs/reference/fleet.md',
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
        help='where results of recordings are kept for later fits '
        '(default: lip_id_ros/fleet in $XDG_CACHE_HOME or ~/.cache)',
    )
    fleet.add_argument('--report', metavar='PAGE.html', help='write a page about the recordings')


def _are_several(args: argparse.Namespace) -> bool:
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


def _check_several(args: argparse.Namespace, inputs: list[str]) -> None:
    """Refuse what belongs to the other engine, and a page in the place of something else."""
    from lip_id_ros.cli import output

    _check_engine(args)
    output.check_distinct(args.output, args.report)
    output.check_file(args.report, inputs, output.is_page, 'a report', args.force)


def _fit_each(args: argparse.Namespace, config: Config, progress: Progress) -> FleetResult:
    """Fit recording by recording, and judge by what is held out."""
    from lip_id_ros.fleet.cache import default_folder, FolderCache
    from lip_id_ros.fleet.fit import fit_fleet
    from lip_id_ros.fleet.sources import find

    sources = find(args.sources, args.group_by)
    cache = FolderCache(args.cache or default_folder())
    with _engine(args) as engine:
        return fit_fleet(sources, config, engine, cache, progress, args.holdout or 0.0)


def _origin(result: FleetResult) -> str:
    """Return how many of the recordings are in the fit, for a title."""
    from lip_id_ros.fleet.results import FITTED

    n_fitted = sum(each.status == FITTED for each in result.recordings)
    return f'{n_fitted} of {len(result.recordings)} recordings, '


def _left_out(result: FleetResult) -> list[str]:
    """Return a line for each recording that is not in the fit."""
    from lip_id_ros.fleet.results import FITTED

    left_out = [each for each in result.recordings if each.status != FITTED]
    lines = [f'{each.name} {each.status}: {each.reason}' for each in left_out[:MOST_LISTED]]
    if len(left_out) > MOST_LISTED:
        lines.append(f'{len(left_out) - MOST_LISTED} more are in the report (--report).')
    return lines


def _write_report(args: argparse.Namespace, result: FleetResult) -> list[str]:
    """Write the page that is asked for; return a line about it."""
    if args.report is None:
        return []
    from lip_id_ros.fleet.report import write_fleet_report  # brings matplotlib

    write_fleet_report(args.report, result, Path(args.output).name)
    return [f'Written: {args.report}']


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
