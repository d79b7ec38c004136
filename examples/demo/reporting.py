"""What both demos share: arguments and exit status, report and table of errors."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
import signal
import sys

from lip_id_ros.cli.output import console
from lip_id_ros.errors import LipIdError
from lip_id_ros.evaluation import Evaluation, Outcome, score
from lip_id_ros.evaluation.report import band, Labels, write_report
from lip_id_ros.evaluation.tables import error_table, notes, show, show_lines
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import Progress

TITLE = 'A simulated Panda on an unseen motion'
REPORT = 'report'
TERMINATED = 143
INTERRUPTED = 130  # what a shell expects after Ctrl-C


def run_demo(
    demonstrate: Callable[[Path], Evaluation],
    argv: Sequence[str] | None,
    description: str | None,
) -> int:
    """Run a demonstration, which gets the output folder; 1 where something is missing, else 0."""
    parser = argparse.ArgumentParser(prog='make demo', description=description)
    parser.add_argument('--output', default='demo_output', metavar='DIR', help='where to write')
    output = Path(parser.parse_args(argv).output).resolve()
    # ends the nodes, which have a session of their own
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(TERMINATED))
    try:
        output.mkdir(parents=True, exist_ok=True)
        evaluation = demonstrate(output)
    except (LipIdError, OSError) as error:
        print(f'demo: error: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return INTERRUPTED
    out = console()
    show(error_table(evaluation, TITLE), out)
    show_lines([*notes(evaluation), f'Report: {output / REPORT / "index.html"}'], out)
    return 0


def report(
    folder: Path,
    model: InverseDynamicsModel,
    outcome: Outcome,
    facts: Sequence[tuple[str, str]],
    progress: Progress,
) -> Evaluation:
    """Evaluate the predictions of a model and write plots and page; `facts` come first there."""
    evaluation = score(outcome)
    uncertainty = band(model, outcome, progress)
    known = (
        ('arm', 'Franka Emika Panda, rigid bodies simulated with pinocchio'),
        *facts,
        ('model', f'{model.kernel} kernel, {model.n_samples} samples'),
    )
    write_report(folder, outcome, evaluation, uncertainty, Labels(TITLE, (), known), progress)
    return evaluation
