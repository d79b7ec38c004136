"""From the arguments of `lip_id compare` to what is compared."""

from __future__ import annotations

import argparse
from dataclasses import replace
import os

from lip_id_ros.comparison import Case, thinned
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import matched
from lip_id_ros.preprocessing import for_training, load_dataset
from lip_id_ros.progress import Progress
from lip_id_ros.settings import Config


def cases(args: argparse.Namespace, config: Config, progress: Progress) -> list[Case]:
    """
    Load what to learn from and what to be judged on.

    Raises
    ------
    LipIdError
        If a source cannot be used, or joints are missing in a test.
    OSError
        If a source cannot be opened.

    """
    data = load_dataset(args.sources, config, progress)
    if args.test:
        train, tests = data, _tests(args.test, data, config, progress)
    else:
        train, rest = data.split(args.train_share)
        tests = {f'the last {100 * (1 - args.train_share):g} %': rest}
    train = for_training(train, config.preprocessing)
    counts = args.samples or (train.n_samples,)
    return [
        Case(f'{count} samples', f'{count} training samples', some, tests, args.urdf)
        for count in counts
        for some in [thinned(train, count)]
    ]


def words(args: argparse.Namespace) -> tuple[str, list[tuple[str, str]]]:
    """Return the title of the page, and where its numbers come from."""
    unseen = ', '.join(args.test) if args.test else f'the rest after {args.train_share:g}'
    facts = [
        ('recordings', ', '.join(args.sources)),
        ('unseen', unseen),
        ('URDF', args.urdf or 'none'),
        ('settings', args.config or 'defaults'),
    ]
    return 'Inverse dynamics: models compared', facts


def _tests(
    sources: list[str], train: Dataset, config: Config, progress: Progress
) -> dict[str, Dataset]:
    joints = replace(config.recording, joints=train.joint_names)
    asked = replace(config, recording=joints)
    names = [os.path.basename(os.path.normpath(source)) for source in sources]
    labels = names if len(set(names)) == len(names) else sources
    return {
        label: matched(load_dataset([source], asked, progress), train)
        for label, source in zip(labels, sources, strict=True)
    }
