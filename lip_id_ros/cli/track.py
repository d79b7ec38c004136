"""
Show on a simulated Panda what learned feedforward is worth: the paper's tracking experiment.

The arm follows a reference under a wrong nominal model; a model is learned from that run; then
references are followed with the nominal and with the learned feedforward.
"""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'track references on a simulated arm with learned and with nominal feedforward'
EPILOG = """\
examples:
  lip_id track -o tracking              one nominal model; pictures and page in tracking/
  lip_id track -o tracking --seeds 5    five random nominal models

Needs pinocchio: `pip install lip_id_ros[sim]`.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        '-o', '--output', metavar='DIR', help='write plots, a web page and the model there'
    )
    parser.add_argument(
        '--seeds',
        type=arguments.count,
        default=1,
        metavar='K',
        help='how many random nominal models (default: 1)',
    )
    arguments.add_json(parser)


def run(args: argparse.Namespace) -> None:
    """Simulate, learn, track, show and write."""
    from lip_id_ros.cli import output, show
    from lip_id_ros.cli.progress_display import progress_display
    from lip_id_ros.evaluation.terminal import show as show_table
    from lip_id_ros.tracking import Experiment, figures, trials
    from lip_id_ros.tracking.figures import notes, tables
    from lip_id_ros.tracking.report import write_report
    from lip_id_ros.tracking.setup import panda_setup

    output.require_folder(args.json)
    output.require_no_file(args.output)
    experiment = Experiment()
    with progress_display() as progress:
        done = list(trials(panda_setup(), experiment, args.seeds, progress))
    result = figures(done)
    console = output.console(args.json)
    for table in tables(result):
        show_table(table, console)
    texts = notes(result)
    if args.output:
        page = write_report(args.output, experiment, done[0], result)
        model = page.with_name('model.npz')
        done[0].model.save(model)
        texts.append(f'Written: {page}, {model}')
    show.sentences(texts, console)
    output.write_json(args.json, result.to_json())
