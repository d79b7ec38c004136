"""Describe a recording, a data set or a model."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from lip_id_ros.cli import arguments

if TYPE_CHECKING:
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
    from pathlib import Path

    from lip_id_ros.cli import models, output, show
    from lip_id_ros.dataset import DATASET_SUFFIX
    from lip_id_ros.evaluation.recording_health import RecordingHealth
    from lip_id_ros.evaluation.tables import show_lines
    from lip_id_ros.loading import election_lines
    from lip_id_ros.model.checked_file import COMPARED, MODEL, schema_of
    from lip_id_ros.model.serialization import contradictions
    from lip_id_ros.preprocessing import describe

    output.check_file(args.json, [args.file], output.is_json, 'a JSON object', args.force)
    output.check_folder(args.report, args.force)
    recording = models.chosen_config(args.config, {}).recording
    health = RecordingHealth(recording, keep_samples=args.report is not None)
    cautions = []
    with output.progress_display() as progress:
        if Path(args.file).suffix == DATASET_SUFFIX and schema_of(args.file) in (MODEL, COMPARED):
            model = models.load(args.file)
            cautions = models.cautions(model)
            with contradictions(args.file):
                described = show.described_model(model)
                cautions += election_lines(model.provenance)
            description = {'file': args.file, 'kind': 'model', **described}
        else:
            description = describe(args.file, progress, health)
        if args.efforts:
            efforts, elected = _effort_findings(args, progress)
            cautions += elected
            cautions += [finding.text for finding in efforts] or [UNDISPUTED]
        if args.report:
            from lip_id_ros.evaluation.report.recording_report import write_recording_report

            write_recording_report(args.report, args.file, health.seen, progress, health.units)
    console = output.console(args.json)
    show.described(description, console)
    show_lines(cautions, console)
    if args.efforts:
        description['efforts'] = [finding.to_json() for finding in efforts]
    output.write_json(args.json, description)


def _effort_findings(
    args: argparse.Namespace, progress: Progress
) -> tuple[tuple[Finding, ...], list[str]]:
    """Return what the efforts are found to be, and what preprocessing was elected for that."""
    from lip_id_ros.cli.models import chosen_config
    from lip_id_ros.health.effort_meaning import diagnose_effort
    from lip_id_ros.loading import election_lines, load_dataset

    dataset = load_dataset(args.file, chosen_config(args.config, {}), progress)
    return diagnose_effort(dataset, progress=progress), election_lines(dataset.provenance)
