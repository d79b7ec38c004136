"""The demonstration without ROS, in small."""

from __future__ import annotations

from pathlib import Path

import pytest

from examples.demo import offline
from examples.demo.reporting import run_demo
from lip_id_ros.errors import LipIdError
from lip_id_ros.evaluation import Evaluation
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.settings import Config, FitSettings, PreprocessingSettings

pytestmark = pytest.mark.slow

Capture = pytest.CaptureFixture[str]

SMALL = offline.Size(n_joints=3, duration=25.0)
QUICK = Config(
    preprocessing=PreprocessingSettings(decimate=20),
    fit=FitSettings(subset=60, iterations=20),
)


@pytest.fixture(scope='module')
def output(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp('demo')


@pytest.fixture(scope='module')
def evaluation(output: Path) -> Evaluation:
    pytest.importorskip('pinocchio', reason='needs pinocchio (the extra sim)')
    return offline.demonstrate(output, SMALL, QUICK)


def test_a_simulated_arm_is_learned_from_a_bag(evaluation: Evaluation, output: Path) -> None:
    assert evaluation.against_truth
    assert evaluation.joint_names == ('panda_joint1', 'panda_joint2', 'panda_joint3')
    assert max(evaluation.nmse_percent) < 5
    assert evaluation.kinetic_nmse_percent is not None
    assert evaluation.kinetic_nmse_percent < 2
    assert evaluation.potential_nmse_percent is not None
    assert evaluation.potential_nmse_percent < 0.1


def test_everything_is_left_for_a_look(evaluation: Evaluation, output: Path) -> None:
    written = {path.name for path in output.iterdir()}
    assert written == {'training_bag', 'test_bag', 'panda.npz', 'report'}
    assert 'an unseen motion' in (output / 'report' / 'index.html').read_text()
    assert InverseDynamicsModel.load(output / 'panda.npz').n_joints == 3


def test_training_and_test_are_different_motions(output: Path, evaluation: Evaluation) -> None:
    bags = [(output / name / f'{name}.mcap').read_bytes() for name in ('training_bag', 'test_bag')]
    assert bags[0] != bags[1]


def test_it_can_be_run_again(output: Path, evaluation: Evaluation) -> None:
    again = offline.record(output / 'test_bag', offline.TEST_SEED, SMALL)
    assert (again.bag / 'metadata.yaml').is_file()


def test_errors_and_the_place_of_the_report_are_shown(
    evaluation: Evaluation, tmp_path: Path, capsys: Capture
) -> None:
    assert run_demo(lambda _: evaluation, ['--output', str(tmp_path)], None) == 0
    shown = capsys.readouterr().out
    assert 'panda_joint3' in shown
    assert 'report/index.html' in shown.replace('\n', '')


def test_what_is_missing_is_said_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    def fail(*_: object) -> None:
        raise LipIdError('a simulated arm needs pinocchio')

    monkeypatch.setattr(offline, 'panda', fail)

    assert offline.main(['--output', str(tmp_path)]) == 1
    assert capsys.readouterr().err == 'demo: error: a simulated arm needs pinocchio\n'
