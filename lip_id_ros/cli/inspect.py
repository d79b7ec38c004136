"""Describe a recording, a data set or a model."""

from __future__ import annotations

import argparse
from typing import Any, TYPE_CHECKING

from lip_id_ros.cli import arguments

if TYPE_CHECKING:
    from rich.console import Console

    from lip_id_ros.health import Finding
    from lip_id_ros.progress import Progress

HELP = 'describe a recording, a data set or a model'
EPILOG = """\
examples:
  lip_id inspect my_bag                  contents and findings
  lip_id inspect my_bag --report out     plots, and out/index.html with all of them
  lip_id inspect my_bag --efforts        are the efforts torques? (a minute or more)
  lip_id inspect arm.npz --json -
"""


UNDISPUTED = 'No other reading of the efforts explains them clearly better than the recorded one.'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        'file',
        metavar='FILE',
        type=arguments.source,
        help=f'{arguments.SOURCE_HELP}, or model .npz',
    )
    arguments.add_json(parser)
    parser.add_argument(
        '--report', metavar='DIR', help='write plots of a recording and a web page there'
    )
    parser.add_argument(
        '--efforts',
        action='store_true',
        help='search for what the efforts of a recording are: without gravity, motor currents, '
        'of another sign or order of joints (a minute or more)',
    )
    arguments.add_config(parser, 'default settings; types of joints and meaning of efforts')
    arguments.add_force(parser)


def run(args: argparse.Namespace) -> None:
    """Describe and show."""
    from lip_id_ros.cli import output

    output.check_json(args.json, [args.file], args.force)
    output.check_folder(args.report, args.force)
    console = output.console(args.json)
    description = _model(args, console) if _is_model(args.file) else _recording(args, console)
    output.write_json(args.json, description)


def _is_model(file: str) -> bool:
    from pathlib import Path

    from lip_id_ros.checked_file import is_model
    from lip_id_ros.dataset import DATASET_SUFFIX

    return Path(file).suffix == DATASET_SUFFIX and is_model(file)


def _model(args: argparse.Namespace, console: Console) -> dict[str, Any]:
    from lip_id_ros.cli import models, show
    from lip_id_ros.errors import ConfigError
    from lip_id_ros.evaluation import fit_cautions
    from lip_id_ros.evaluation.tables import show_lines
    from lip_id_ros.model.serialization import contradictions

    for option in ('report', 'efforts', 'config'):
        if getattr(args, option):
            raise ConfigError(
                f'--{option} is about recordings, but {args.file} is a model; leave it out, or '
                'see lip_id evaluate.'
            )
    model = models.load(args.file)
    with contradictions(args.file):
        description = {'file': args.file, 'kind': 'model', **show.described_model(model)}
        cautions = fit_cautions(model)
        show.inspected_model(model, description, console)
    show_lines(cautions, console)
    return description


def _recording(args: argparse.Namespace, console: Console) -> dict[str, Any]:
    from lip_id_ros.cli import output, show
    from lip_id_ros.evaluation.recording_health import RecordingHealth
    from lip_id_ros.evaluation.tables import show_lines
    from lip_id_ros.preprocessing import describe
    from lip_id_ros.settings import Config, read_config

    recording = (read_config(args.config) if args.config else Config()).recording
    health = RecordingHealth(recording, keep_samples=args.report is not None)
    lines: list[str] = []
    with output.progress_display() as progress:
        description = describe(args.file, progress, health)
        if args.efforts:
            findings, lines = _effort_findings(args, progress)
            description['efforts'] = [finding.to_json() for finding in findings]
            lines += [finding.text for finding in findings] or [UNDISPUTED]
        if args.report:
            from lip_id_ros.evaluation.report.recording_report import write_recording_report

            page = write_recording_report(
                args.report, args.file, health.seen, progress, health.units, health.are_torques
            )
            lines.append(f'Written: {page}')
    shown = {name: value for name, value in description.items() if name != 'efforts'}
    show.described(shown, console)
    show_lines(lines, console)
    return description


def _effort_findings(
    args: argparse.Namespace, progress: Progress
) -> tuple[tuple[Finding, ...], list[str]]:
    """Return what the efforts are found to be, and what preprocessing was selected for that."""
    from lip_id_ros.cli.models import chosen_config
    from lip_id_ros.evaluation import data_remarks
    from lip_id_ros.health.effort_meaning import diagnose_effort
    from lip_id_ros.loading import load_dataset

    dataset = load_dataset(args.file, chosen_config(args.config, {}), progress)
    return diagnose_effort(dataset, progress=progress), data_remarks(dataset.provenance)
