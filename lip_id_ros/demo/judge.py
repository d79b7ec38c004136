"""Verdicts on the errors of the demo, its tables and its exit status."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
from pathlib import Path
import signal
import sys

from lip_id_ros.cli.output import console
from lip_id_ros.errors import LipIdError
from lip_id_ros.evaluation import Evaluation, Outcome, score
from lip_id_ros.evaluation.report import band, Labels, write_report
from lip_id_ros.evaluation.tables import error_table, notes, percent, show, show_lines, Table
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import Progress

TITLE = 'A simulated Panda on an unseen motion'
REPORT = 'report'
TERMINATED = 143
INTERRUPTED = 130  # what a shell expects after Ctrl-C
TORQUE_NOISE = 0.05  # of the simulated sensors [N m]
TORQUE_LIMIT_PERCENT = 5.0
KINETIC_LIMIT_PERCENT = 2.0
LEAST_SIGNAL_TO_NOISE = 10.0  # below this, an error is mostly that of the noise


@dataclass(frozen=True)
class Verdict:
    """
    One figure of a joint or the kinetic energy, and its limit.

    It is not judged where the signal is too small to judge by.

    """

    name: str
    nmse_percent: float
    limit_percent: float
    judged: bool = True

    @property
    def failed(self) -> bool:
        """Whether the figure is judged, and is above its limit or no number at all."""
        return self.judged and not self.nmse_percent <= self.limit_percent

    @property
    def word(self) -> str:
        """The verdict in words."""
        if not self.judged:
            return 'not judged: close to the noise'
        return 'TOO LARGE' if self.failed else 'ok'


def judge(evaluation: Evaluation, noise_std: Sequence[float]) -> list[Verdict]:
    """
    Judge the torque of every joint, and last the kinetic energy, against the truth.

    A joint whose torque has a standard deviation within ten times the noise (n,) of its sensor [N
    m or N] is reported, not judged.

    """
    joints = zip(
        evaluation.joint_names,
        evaluation.nmse_percent,
        evaluation.torque_std,
        noise_std,
        strict=True,
    )
    verdicts = [
        Verdict(name, nmse, TORQUE_LIMIT_PERCENT, judged=std > LEAST_SIGNAL_TO_NOISE * noise)
        for name, nmse, std, noise in joints
    ]
    kinetic = evaluation.kinetic_nmse_percent
    verdicts.append(
        Verdict('kinetic energy', math.nan if kinetic is None else kinetic, KINETIC_LIMIT_PERCENT)
    )
    return verdicts


def verdict_table(verdicts: Sequence[Verdict]) -> Table:
    """Return the verdicts as a table."""
    rows = [
        (verdict.name, percent(verdict.nmse_percent), f'{verdict.limit_percent:g}', verdict.word)
        for verdict in verdicts
    ]
    return Table('Verdict', ('', 'nMSE [%]', 'limit [%]', ''), rows)


def run_demo(
    demonstrate: Callable[[Path], Evaluation],
    argv: Sequence[str] | None,
    description: str | None,
) -> int:
    """
    Run a demonstration, which gets the output folder, as a program.

    Returns 0, or 1 where an error is above its limit or something is missing.

    """
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
    return conclude(evaluation, output)


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


def conclude(evaluation: Evaluation, output: Path) -> int:
    """Print figures and verdicts; return the exit status."""
    out = console()
    show(error_table(evaluation, TITLE), out)
    show_lines(notes(evaluation), out)
    verdicts = judge(evaluation, [TORQUE_NOISE] * len(evaluation.joint_names))
    show(verdict_table(verdicts), out)
    show_lines([f'Report: {output / REPORT / "index.html"}'], out)
    return 1 if any(verdict.failed for verdict in verdicts) else 0
