"""
The demonstration on a real ROS graph: a simulated Panda, `train` and `serve` in their processes.

The arm moves and `train` records and fits; then the arm makes a motion that the model has not
seen, `serve` answers its reference, and what went over the graph is kept in a bag and judged.

"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
import shutil
import sys
import time

from lip_id_ros.cli.output import progress_display
from lip_id_ros.demo import topics
from lip_id_ros.demo.bag_recorder import BagRecorder
from lip_id_ros.demo.comparison import outcome_of, read_served, Served
from lip_id_ros.demo.graph import Graph, spinning
from lip_id_ros.demo.offline import conclude, REPORT, TEST_SEED, TITLE
from lip_id_ros.demo.plan import make_plan, require_efforts
from lip_id_ros.demo.processes import launched
from lip_id_ros.errors import LipIdError
from lip_id_ros.evaluation import Evaluation, score
from lip_id_ros.evaluation.report import band, Labels, write_report
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import Progress
from lip_id_ros.recording.bag_writer import RawBag
from lip_id_ros.simulation import panda

MODEL = 'model.npz'
BAG = 'served_bag'
TRAINING_ROWS = 5000  # one period of the motion at 100 Hz
SERVED_ROWS = 2500
START_SECONDS, RECORD_SECONDS, FIT_SECONDS, SERVE_SECONDS = 60.0, 120.0, 600.0, 60.0
INTERRUPTED = 130  # what a shell expects after Ctrl-C
SETTLE_SECONDS = 1.0  # for messages under way, and for subscriptions to find each other


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run the demonstration.

    Returns
    -------
    int
        0, or 1 where an error is above its limit or something is missing.

    """
    parser = argparse.ArgumentParser(prog='lip_id_ros.demo.ros', description=__doc__)
    parser.add_argument('--output', default='demo_output', metavar='DIR', help='where to write')
    arguments = parser.parse_args(argv)
    output = Path(arguments.output).resolve()
    try:
        evaluation = demonstrate(output)
    except (LipIdError, OSError) as error:
        print(f'demo: error: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return INTERRUPTED
    return conclude(evaluation, output)


def demonstrate(output: Path) -> Evaluation:
    """
    Record, fit, serve, compare and report.

    Parameters
    ----------
    output : Path
        Gets the model, the data set, the bag, the nodes' log and the report.

    Returns
    -------
    Evaluation
        Of what `serve` answered, against the truth.

    """
    output.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(output / BAG, ignore_errors=True)
    with progress_display() as progress:
        with launched(output) as nodes, spinning('conductor') as node:
            graph = Graph(node, lambda: nodes.poll() is None)
            learn(graph, progress)
            with RawBag(output / BAG, topics.TYPES) as bag:
                serve(graph, BagRecorder(node, bag), progress)
        return report(output, progress)


def learn(graph: Graph, progress: Progress) -> None:
    """Let `train` record one period of the motion, save it and fit."""
    graph.wait_until(lambda: bool(graph.train_status), 'the status of train', START_SECONDS)
    graph.set_recording(True)
    graph.set_robot(paused=False)

    def recorded() -> bool:
        rows = graph.train_status['rows']
        progress('record', min(rows, TRAINING_ROWS), TRAINING_ROWS)
        return bool(rows >= TRAINING_ROWS)

    graph.wait_until(recorded, 'the recording', RECORD_SECONDS)
    graph.set_recording(False)
    graph.set_robot(paused=True)
    graph.save_dataset()
    graph.start_fit()
    graph.wait_until(lambda: fitted(graph, progress), 'the fit', FIT_SECONDS)


def fitted(graph: Graph, progress: Progress) -> bool:
    """Tell whether the fit is done, and pass its progress on."""
    job = graph.train_status['job']
    if job['task'] != 'fit':
        return False
    if job['state'] == 'failed':
        raise LipIdError(f'the fit failed: {job["error"]}')
    progress(job['stage'], job['done'], job['total'])
    return bool(job['state'] == 'done')


def serve(graph: Graph, recorder: BagRecorder, progress: Progress) -> None:
    """Let `serve` answer an unseen motion, then a plan of the same motion."""
    graph.activate_serve()
    graph.set_robot(seed=TEST_SEED)
    time.sleep(SETTLE_SECONDS)
    graph.set_robot(paused=False)

    def answered() -> bool:
        done = recorder.counts[topics.TORQUE]
        progress('serve', min(done, SERVED_ROWS), SERVED_ROWS)
        return bool(done >= SERVED_ROWS)

    graph.wait_until(answered, 'an answer to every reference', SERVE_SECONDS)
    graph.set_robot(paused=True)
    graph.publish_plan(make_plan(TEST_SEED))
    graph.wait_until(
        lambda: recorder.counts[topics.PLAN_WITH_EFFORT] > 0, 'the plan', SERVE_SECONDS
    )
    time.sleep(SETTLE_SECONDS)
    recorder.stop()


def report(output: Path, progress: Progress) -> Evaluation:
    """Compare the bag with the truth and write plots and page."""
    arm = panda()
    model = InverseDynamicsModel.load(output / MODEL)
    served = read_served(output / BAG, arm.joint_names)
    require_efforts(output / BAG)
    outcome = outcome_of(served, arm, model)
    evaluation = score(outcome)
    uncertainty = band(model, outcome, progress)
    labels = Labels(TITLE, (), facts(model, served))
    write_report(output / REPORT, outcome, evaluation, uncertainty, labels, progress)
    return evaluation


def facts(model: InverseDynamicsModel, served: Served) -> tuple[tuple[str, str], ...]:
    """Say where model and data come from."""
    return (
        ('arm', 'Franka Emika Panda, rigid bodies simulated with pinocchio'),
        ('graph', 'simulated_panda, train and serve, each in its own process'),
        ('answers', f'{len(served.stamps)} references, every one answered by serve'),
        ('model', f'{model.kernel} kernel, {model.n_samples} samples'),
    )


if __name__ == '__main__':
    sys.exit(main())
