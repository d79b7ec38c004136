"""Fit several models to the same recordings and judge them on the same unseen motion."""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'compare models of the literature and ours on the same data'
DEFAULT_MODELS = 'se,gip,lip,recursive,articulated'
EPILOG = """\
models:
  articulated                  of this package, its default: rigid links found in the data
  recursive, lip               of this package, on energies alone; lip is the paper's
  se, gip                      one Gaussian process per joint: squared exponential, polynomial
  lse                          squared exponential on the Lagrangian
  delan                        deep Lagrangian network
  rigid_body, semiparametric   identification with known kinematics (--urdf)

examples:
  lip_id compare my_bag -o out                         the last 30 % are the unseen motion
  lip_id compare run1.mcap run2.mcap --test run3.mcap run4.mcap -o out
  lip_id compare my_bag --models articulated,rigid_body --urdf arm.urdf -o out
  lip_id compare my_bag --samples 50,100,200,400 -o out    error against number of samples

out/index.html has all figures, out/comparison.json all numbers. What is finished is kept in
out/cells: the same command again goes on where it was interrupted.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_sources(parser)
    parser.add_argument('-o', '--output', required=True, metavar='DIR', help='folder to write')
    parser.add_argument(
        '--models',
        type=arguments.joint_names,
        default=DEFAULT_MODELS,
        metavar='A,B,...',
        help=f'which ones (default: {DEFAULT_MODELS})',
    )
    unseen = parser.add_mutually_exclusive_group()
    unseen.add_argument(
        '--train-share',
        type=arguments.share,
        default=0.7,
        metavar='SHARE',
        help='share of the samples, the first in time, to learn from (default: 0.7)',
    )
    unseen.add_argument(
        '--test', nargs='+', metavar='SOURCE', help='recordings to be judged on, each by itself'
    )
    parser.add_argument(
        '--samples',
        type=arguments.counts,
        metavar='N,M,...',
        help='learn from so many samples, evenly spaced (default: all)',
    )
    parser.add_argument('--urdf', metavar='FILE', help='robot description')
    arguments.add_config(parser, 'default settings')
    arguments.add_joints(parser)
    parser.add_argument(
        '--seed', type=int, metavar='K', help='seed of every random choice (default: 0)'
    )


def run(args: argparse.Namespace) -> None:
    """Compare, show and write."""
    from pathlib import Path

    from lip_id_ros.cli import comparing, output, settings, show
    from lip_id_ros.cli.progress_display import progress_display
    from lip_id_ros.comparison import compare, Store
    from lip_id_ros.comparison.report import write_comparison
    from lip_id_ros.comparison.summary import remarks, tables
    from lip_id_ros.evaluation.terminal import show as show_table

    output.require_no_file(args.output)
    config = settings.for_comparison(args)
    with progress_display() as progress:
        cases = comparing.cases(args, config, progress)
        store = Store(Path(args.output) / 'cells')
        results = compare(cases, args.models, config.fit, store, progress)
        title, facts = comparing.words(args)
        page = write_comparison(Path(args.output), title, cases, results, store, facts, progress)
    console = output.console()
    for table in tables(results):
        show_table(table, console)
    show.sentences([*remarks(results), f'Written: {page}'], console)
