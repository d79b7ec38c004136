"""Fit several models to the same recordings and evaluate them on the same unseen motion."""

from __future__ import annotations

import argparse
from dataclasses import replace
import os
from pathlib import Path

from benchmarks.comparison import Case, compare, Store, thinned
from benchmarks.comparison.report import write_comparison
from benchmarks.comparison.run import remarks, tables
from lip_id_ros.cli import arguments, models, output
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import matched
from lip_id_ros.evaluation.tables import show, show_lines
from lip_id_ros.loading import load_dataset, with_selected
from lip_id_ros.preprocessing import for_training
from lip_id_ros.progress import Progress
from lip_id_ros.settings import Config

CELLS = 'cells'
DEFAULT_MODELS = 'se,gip,lip,recursive,articulated'
TITLE = 'Inverse dynamics: models compared'
EPILOG = """\
models:
  articulated                  of this package, the default: rigid links located by the fit
  recursive, lip               of this package: energies alone; lip is the paper's
  se, gip                      one Gaussian process per joint: squared exponential, polynomial
  lse                          squared exponential on the Lagrangian
  delan                        deep Lagrangian network
  rigid_body, semiparametric   identification with known kinematics (--urdf)
  rigid_body_friction          the same with the friction terms of articulated

examples (python -m benchmarks compare_models ...):
  my_bag -o out                                   the last 30 % are the unseen motion
  run1.mcap run2.mcap --test run3.mcap run4.mcap -o out
  my_bag --models articulated,rigid_body --urdf arm.urdf -o out
  my_bag --samples 50,100,200,400 -o out          error against number of samples

out/index.html has all figures, out/comparison.json all numbers. Finished fits are kept in
out/cells: the same command continues an interrupted comparison.
"""


def main(given: list[str]) -> int:
    """Compare, show and write."""
    args = _options(given)
    folder = Path(args.output)
    if not (folder / CELLS).is_dir():  # an interrupted comparison has no page yet
        output.check_folder(args.output, args.force)
    chosen = {'recording.joints': args.joints, 'fit.seed': args.seed}
    config = models.chosen_config(args.config, chosen)
    with output.progress_display() as progress:
        cases = _cases(args, config, progress)
        store = Store(folder / CELLS)
        results = compare(cases, args.models, config.fit, store, progress)
        page = write_comparison(folder, TITLE, cases, results, store, _facts(args), progress)
    console = output.console()
    for table in tables(results):
        show(table, console)
    show_lines([*remarks(results), f'Written: {page}'], console)
    return 0


def _options(given: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='benchmarks compare_models',
        description=__doc__,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    arguments.add_sources(parser)
    arguments.add_output(parser, 'DIR', 'folder to write')
    parser.add_argument(
        '--models',
        type=arguments.joint_names,
        default=DEFAULT_MODELS,
        metavar='A,B,...',
        help=f'models by name (default: {DEFAULT_MODELS})',
    )
    unseen = parser.add_mutually_exclusive_group()
    unseen.add_argument(
        '--train-share',
        type=arguments.share,
        default=0.7,
        metavar='SHARE',
        help='share of the samples, the first in time, for training (default: 0.7)',
    )
    unseen.add_argument(
        '--test',
        nargs='+',
        type=arguments.source,
        metavar='SOURCE',
        help='unseen motions, evaluated one by one',
    )
    parser.add_argument(
        '--samples',
        type=_counts,
        metavar='N,M,...',
        help='numbers of training samples, evenly spaced (default: all)',
    )
    parser.add_argument('--urdf', type=arguments.source, metavar='FILE', help='robot description')
    arguments.add_config(parser, 'default settings')
    arguments.add_joints(parser)
    arguments.add_seed(parser)
    arguments.add_force(parser)
    return parser.parse_args(given)


def _cases(args: argparse.Namespace, config: Config, progress: Progress) -> list[Case]:
    """Load training data and unseen motions."""
    share = 1.0 if args.test else args.train_share
    data = load_dataset(args.sources, config, progress, training_share=share)
    if args.test:
        train, tests = data, _tests(args.test, data, config, progress)
    else:
        train, rest = data.split(args.train_share)
        tests = {f'the last {100 * (1 - args.train_share):g} %': rest}
    train = for_training(train, config.preprocessing, config.fit.kernel)
    counts = args.samples or (train.n_samples,)
    return [
        Case(f'{count} samples', f'{count} training samples', some, tests, args.urdf)
        for count in counts
        for some in [thinned(train, count)]
    ]


def _tests(
    sources: list[str], train: Dataset, config: Config, progress: Progress
) -> dict[str, Dataset]:
    config = with_selected(config, train.provenance)
    recording = replace(config.recording, joints=train.joint_names)
    names = [os.path.basename(os.path.normpath(source)) for source in sources]
    labels = names if len(set(names)) == len(names) else sources
    return {
        label: matched(
            load_dataset([source], replace(config, recording=recording), progress), train
        )
        for label, source in zip(labels, sources, strict=True)
    }


def _facts(args: argparse.Namespace) -> list[tuple[str, str]]:
    last = f'the last {100 * (1 - args.train_share):g} % of the samples'
    unseen = ', '.join(args.test) if args.test else last
    return [
        ('recordings', ', '.join(args.sources)),
        ('unseen', unseen),
        ('URDF', args.urdf or 'none'),
        ('settings', args.config or 'defaults'),
    ]


def _counts(text: str) -> tuple[int, ...]:
    """Read whole numbers above zero, separated by commas; return them in rising order."""
    return tuple(sorted({arguments.count(part.strip()) for part in text.split(',')}))
