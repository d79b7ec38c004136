"""
Learn a simulated arm, judge the model on another motion, and open the report in a browser.

Two recordings of a simulated arm are written as a driver would record them. Then the verbs that
you would use run on them. Nothing is asked of the network.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import shlex
from typing import Any, TYPE_CHECKING

from lip_id_ros.cli import arguments, evaluate, fit, inspect

if TYPE_CHECKING:
    from rich.console import Console

HELP = 'learn a simulated arm, without a robot, and open the report'
EPILOG = """\
examples:
  lip_id demo                            recordings, model and report in lip_id_demo/
  lip_id demo -o elsewhere --no-browser
"""
SECONDS = 50
RATE_HZ = 100.0
TORQUE_NOISE = (0.3, 0.4, 0.2, 0.05)  # N m
POSITION_NOISE = 2e-5  # rad
VELOCITY_NOISE = 1e-3  # rad/s
NEXT = """\
Next, with recordings of your own arm (rosbag2, .mcap, ROS 1 .bag or .csv):
  lip_id inspect my_bag                              what was recorded, and what is wrong with it
  lip_id fit my_bag -o arm.npz --holdout 0.3         add --urdf arm.urdf where you have one
  lip_id evaluate arm.npz another_bag --report report"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        '-o',
        '--output',
        default='lip_id_demo',
        metavar='DIR',
        help='folder of the recordings, the model and the report (default: lip_id_demo)',
    )
    parser.add_argument(
        '--seconds',
        type=arguments.count,
        default=SECONDS,
        metavar='S',
        help=f'length of each recording (default: {SECONDS})',
    )
    parser.add_argument('--no-browser', action='store_true', help='do not open the report')
    arguments.add_force(parser)


def run(args: argparse.Namespace) -> None:
    """Record, run the verbs, and open the report."""
    import webbrowser

    from lip_id_ros.cli import output
    from lip_id_ros.evaluation.report.page import INDEX
    from lip_id_ros.evaluation.tables import show_lines

    output.check_folder(args.output, args.force)
    folder = Path(args.output)
    folder.mkdir(parents=True, exist_ok=True)
    training, unseen = str(folder / 'training_bag'), str(folder / 'another_bag')
    model = str(folder / 'arm.npz')
    for seed, bag in enumerate((training, unseen), start=1):
        record(Path(bag), seed, args.seconds)
    console = output.console()
    _run(inspect, console, training)
    _run(fit, console, training, '-o', model)
    _run(evaluate, console, model, unseen, '--report', str(folder), '--force')
    show_lines(NEXT.splitlines(), console)
    if not args.no_browser:
        webbrowser.open((folder / INDEX).resolve().as_uri())


def record(bag: Path, seed: int, seconds: float) -> None:
    """Write a motion of the simulated arm, with noise, as a bag; replace an older one."""
    import shutil

    import numpy as np

    from lip_id_ros.simulation import (
        make_dataset,
        SinusoidTrajectory,
        with_encoder_noise,
        write_bag,
    )
    from lip_id_ros.simulation.four_joints import FourJoints, MOTION

    rng = np.random.default_rng(seed)
    trajectory = SinusoidTrajectory.random(MOTION, rng)
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    exact = make_dataset(FourJoints(), trajectory, t, np.array(TORQUE_NOISE), rng)
    shutil.rmtree(bag, ignore_errors=True)
    write_bag(bag, with_encoder_noise(exact, POSITION_NOISE, VELOCITY_NOISE, rng))


def _run(verb: Any, console: Console, *arguments: str) -> None:
    from lip_id_ros.evaluation.tables import show_lines

    name = verb.__name__.rpartition('.')[2]
    show_lines(['', f'$ {shlex.join(["lip_id", name, *arguments])}'], console)
    parser = argparse.ArgumentParser()
    verb.add_arguments(parser)
    verb.run(parser.parse_args(arguments))
