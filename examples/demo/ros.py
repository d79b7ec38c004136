"""
The demonstration on a real ROS graph: a simulated Panda, `train` and `serve` in their processes.

The arm moves and `train` records and fits; then the arm makes a motion that the model has not
seen, `serve` answers its reference, and the bag of the graph is compared with the truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
import shutil
import sys

from examples.demo.graph import Graph, launched, spinning
from examples.demo.offline import TEST_SEED
from examples.demo.reporting import REPORT, report, run_demo
from examples.demo.served import (
    BagRecorder,
    KINETIC,
    make_plan,
    outcome_of,
    PLAN_WITH_EFFORT,
    POTENTIAL,
    read_served,
    require_efforts,
    TOPICS,
    TORQUE,
)
from lip_id_ros.cli.output import progress_display
from lip_id_ros.errors import LipIdError
from lip_id_ros.evaluation import Evaluation
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import Progress
from lip_id_ros.recording.bag_writer import RawBag
from lip_id_ros.simulation import panda

MODEL = 'model.npz'
BAG = 'served_bag'
TRAINING_ROWS = 5000  # one period of the motion at 100 Hz
SERVED_ROWS = 2500
FIT_SECONDS = 600.0  # a loaded machine compiles for long
QUIET_S = 2.0  # without a message: all answers have come


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demonstration; return the exit status of `run_demo`."""
    return run_demo(demonstrate, argv, __doc__)


def demonstrate(output: Path) -> Evaluation:
    """
    Record, fit, serve, compare the answers of `serve` with the truth and report.

    The output folder gets the model, the data set, the bag, the nodes' log and the report.
    """
    shutil.rmtree(output / BAG, ignore_errors=True)
    with progress_display() as progress:
        with launched(output) as nodes, spinning('conductor') as node:
            graph = Graph(node, lambda: nodes.poll() is None)
            learn(graph, progress)
            with RawBag(output / BAG, TOPICS) as bag:
                serve(graph, BagRecorder(node, bag), progress)
        return judged(output, progress)


def learn(graph: Graph, progress: Progress) -> None:
    """Let `train` record one period of the motion, save it and fit."""
    graph.wait_until(lambda: bool(graph.train_status), 'the status of train')
    graph.set_recording(True)
    graph.set_robot(paused=False)

    def rows() -> int:
        found = int(graph.train_status['rows'])
        progress('record', min(found, TRAINING_ROWS), TRAINING_ROWS)
        return found

    graph.wait_until(lambda: rows() >= TRAINING_ROWS, 'the recording', progress=rows)
    graph.set_recording(False)
    graph.set_robot(paused=True)
    graph.save_dataset()
    graph.start_fit()
    graph.wait_until(
        lambda: fitted(graph, progress), 'the fit', FIT_SECONDS, lambda: graph.train_status['job']
    )


def fitted(graph: Graph, progress: Progress) -> bool:
    """Return whether the fit is done, and report its progress."""
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
    graph.await_discovery()
    graph.set_robot(paused=False)
    counts = recorder.counts

    def answered() -> int:
        progress('serve', min(counts[TORQUE], SERVED_ROWS), SERVED_ROWS)
        return counts[TORQUE]

    graph.wait_until(lambda: answered() >= SERVED_ROWS, 'the torques', progress=answered)
    graph.set_robot(paused=True)
    graph.publish_plan(make_plan(TEST_SEED))
    graph.wait_until(lambda: counts[PLAN_WITH_EFFORT] > 0, 'the efforts of the plan')
    graph.wait_until(
        lambda: (
            counts[TORQUE] == counts[KINETIC] == counts[POTENTIAL] and recorder.quiet_s > QUIET_S
        ),
        'an answer to the last reference',
        progress=counts.total,
    )
    recorder.stop()


def judged(output: Path, progress: Progress) -> Evaluation:
    """Compare the bag with the truth and write plots and page."""
    arm = panda()
    model = InverseDynamicsModel.load(output / MODEL)
    served = read_served(output / BAG, arm.joint_names)
    require_efforts(output / BAG)
    facts = (
        ('graph', 'simulated_panda, train and serve, each in its own process'),
        (
            'answers',
            f'{len(served.stamps)} of {served.n_references} references; late ones are skipped',
        ),
    )
    return report(output / REPORT, model, outcome_of(served, arm, model), facts, progress)


if __name__ == '__main__':
    sys.exit(main())
