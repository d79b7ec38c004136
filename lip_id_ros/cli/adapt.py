"""Follow an arm through recordings of another day: friction that changes, and what it is now."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from lip_id_ros.cli import arguments

if TYPE_CHECKING:
    from lip_id_ros.adaptation.replay import Replay
    from lip_id_ros.evaluation.tables import Table

HELP = 'follow friction that changes through later recordings'
EPILOG = """\
examples:
  lip_id adapt arm.npz tuesday_bag                       has the arm changed?
  lip_id adapt arm.npz mon.mcap tue.mcap -o arm_now.npz  write the model of the arm as it is now
  lip_id adapt arm.npz mon.mcap tue.mcap --report out    plots, and out/index.html with all of them

Recordings come in the order of their time. Each torque is predicted before the model learns from
it, so that the errors are those of a model that follows the arm while it works.
"""

PAUSE_S = 600.0
MEANING = (
    'Learned from: samples in motion and undisturbed, in any range. Trusted: what '
    'was learned had been better for some 7 s of motion; until then the fit itself is followed. '
    'Within 2 std: of what the filter expected, trusted or not.'
)
UNTRUSTED = (
    'What was learned is not trusted at the end: the arm as it is now is still that of the fit. '
    'Adapt to more recordings.'
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_model(parser)
    arguments.add_sources(parser)
    parser.add_argument('-o', '--output', metavar='MODEL', help='write the model as it is now')
    parser.add_argument(
        '--pause',
        type=arguments.seconds,
        default=PAUSE_S,
        metavar='S',
        help='time between recordings [s] (default: 600): friction may change meanwhile',
    )
    arguments.add_config(parser, "the settings of the model's fit")
    arguments.add_json(parser)
    parser.add_argument('--report', metavar='DIR', help='write plots and a web page there')
    arguments.add_force(parser)


def run(args: argparse.Namespace) -> None:
    """Replay, show and write."""
    from lip_id_ros.adaptation.changes import change_lines, changes
    from lip_id_ros.adaptation.replay import replay
    from lip_id_ros.checked_file import is_model
    from lip_id_ros.cli import models, output
    from lip_id_ros.evaluation.cautions import data_remarks
    from lip_id_ros.evaluation.tables import show, show_lines

    inputs = [args.model, *args.sources]
    output.check_distinct(args.json, args.output)
    output.check_json(args.json, inputs, args.force)
    output.check_file(args.output, inputs, is_model, 'a model', args.force)
    output.check_folder(args.report, args.force)
    model = models.load(args.model)
    with output.progress_display() as progress:
        dataset = models.load_examined(model, args.sources, args.config, progress)
        found = replay(model, dataset, args.pause, progress=progress)
        tables = _tables(found)
        remarks = data_remarks(dataset.provenance)
        lines = [MEANING, *remarks, *(each.sentence() for each in found.adaptation.payload_events)]
        lines += change_lines(changes(found.adaptation))
        if not found.adaptation.is_trusted:
            lines.append(UNTRUSTED)
        if args.report:
            from lip_id_ros.adaptation.report import write_report

            page = write_report(args.report, found, tables, lines, progress)
    console = output.console(args.json)
    for table in tables:
        show(table, console)
    show_lines(lines, console)
    if args.report:
        show_lines([f'Written: {page}'], console)
    output.write_json(args.json, {**found.to_json(), 'cautions': remarks})
    if args.output is not None:
        found.adaptation.model.save(args.output)
        show_lines([f'Written: {args.output}'], console)


def _tables(found: Replay) -> list[Table]:
    """Return the errors of each recording: of the fit, and of the arm that is followed."""
    from lip_id_ros.evaluation.metrics import mean_of_known
    from lip_id_ros.evaluation.tables import percent, Table

    tables, names = [], found.adaptation.commissioned.joint_names
    for number, each in enumerate(found.recordings, start=1):
        frozen, followed = each.frozen_percent, each.followed_percent
        rows = [
            (name, percent(a), percent(b), f'{covered:.3g}')
            for name, a, b, covered in zip(
                names, frozen, followed, each.within_two_std_percent, strict=True
            )
        ]
        means = [percent(mean_of_known(tuple(x.tolist()))) for x in (frozen, followed)]
        rows.append(('mean of the joints', means[0], means[1], ''))
        shares = each.followed.learned.mean(), each.followed.trusted.mean()
        learned, trusted = (f'{100.0 * share:.3g} %' for share in shares)
        length = f'{each.t[-1] - each.t[0]:.3g} s'
        title = f'Recording {number}, {length}: {learned} learned from, {trusted} trusted'
        head = ('', 'fit, nMSE [%]', 'followed, nMSE [%]', 'within 2 std [%]')
        tables.append(Table(title, head, rows))
    return tables
