"""What a fit found of the arm's geometry, on the console."""

from __future__ import annotations

from pathlib import Path
import re

from gp.arms import dataset_of, noise_of, random_motion, TwoLinks
from model.models import random_model
import pytest

from lip_id_ros.cli import main
from lip_id_ros.export.kinematics import model_kinematics
from lip_id_ros.identification import fit

Capture = pytest.CaptureFixture[str]
LENGTH = 1


def run(*arguments: str | Path) -> None:
    assert main([str(argument) for argument in arguments]) == 0


@pytest.mark.slow
def test_a_fit_tells_the_length_of_a_link(tmp_path: Path, capsys: Capture) -> None:
    """The planar arm has parallel axes, half a metre apart."""
    arm = TwoLinks(length=0.5)
    motion = random_motion(arm, 200, seed=4)
    tau = arm.torque(*motion)
    dataset_of(arm, motion, tau + noise_of(tau, 0.001)).save(tmp_path / 'arm.npz')
    run('fit', tmp_path / 'arm.npz', '-o', tmp_path / 'model.npz')
    output = ' '.join(capsys.readouterr().out.split())
    assert 'articulated kernel' in output
    assert re.search(r' 0\.(49[89]|50[01])\d ± 0\.0', output)
    assert 'a Gaussian process would not improve it' in output

    run('inspect', tmp_path / 'model.npz')
    output = ' '.join(capsys.readouterr().out.split())
    assert re.search(r' 0\.(49[89]|50[01])\d ± 0\.0', output)


def test_processes_beside_links_are_named(tmp_path: Path, capsys: Capture) -> None:
    random_model('articulated').save(tmp_path / 'model.npz')
    run('inspect', tmp_path / 'model.npz')
    output = ' '.join(capsys.readouterr().out.split())
    assert 'The model has Gaussian processes beside links and friction at joint_1' in output


@pytest.mark.slow
@pytest.mark.parametrize(('noise', 'identified'), [(0.001, True), (3.0, False)])
def test_noise_decides_what_is_identified(noise: float, identified: bool) -> None:
    arm = TwoLinks(length=0.5)
    motion = random_motion(arm, 200, seed=4)
    tau = arm.torque(*motion)
    model = fit(dataset_of(arm, motion, tau + noise_of(tau, noise)))
    kinematics = model_kinematics(model)
    assert kinematics is not None
    assert kinematics.identified[1, LENGTH] == identified
    if identified:
        length, std = kinematics.values[1, LENGTH], kinematics.std[1, LENGTH]
        assert length == pytest.approx(0.5, abs=3.0 * std)


@pytest.mark.slow
def test_an_elected_length_keeps_its_deviation() -> None:
    """The axes of a hand of no weight seem to meet."""
    arm = TwoLinks(length=0.0)
    motion = random_motion(arm, 200, seed=4)
    tau = arm.torque(*motion)
    model = fit(dataset_of(arm, motion, tau + noise_of(tau, 0.001)))
    report = model.summary['denavit_hartenberg']
    assert report['length_std_m'][1] > 0.0
    assert '-0.0' not in [str(number) for numbers in report.values() for number in numbers]
