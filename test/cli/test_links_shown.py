"""What a fit found of the arm's geometry, on the console."""

from __future__ import annotations

from pathlib import Path
import re

from gp.arms import dataset_of, noise_of, random_motion, TwoLinks
from model.models import random_model
import pytest

from lip_id_ros.cli import main
from lip_id_ros.cli.show import axes, Axis
from lip_id_ros.identification import fit

Capture = pytest.CaptureFixture[str]


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
    assert 'each axis to the previous one, found in the data' in output
    assert re.search(r' 0\.(499|50[01]) m', output)
    assert 'a Gaussian process would not improve it' in output

    run('inspect', tmp_path / 'model.npz')
    output = ' '.join(capsys.readouterr().out.split())
    assert 'remainder: none' in output
    assert output.count('distance_m') == 1


def test_a_slide_is_no_distance_away(tmp_path: Path, capsys: Capture) -> None:
    types = ('revolute', 'revolute', 'prismatic')
    random_model('articulated', types=types).save(tmp_path / 'model.npz')
    run('inspect', tmp_path / 'model.npz')
    output = ' '.join(capsys.readouterr().out.split())
    assert 'remainder: joint_1, joint_3' in output
    assert output.count('angle_deg') == 2
    assert output.count('distance_m: none') == 1


@pytest.mark.slow
@pytest.mark.parametrize(('noise', 'identified'), [(0.001, True), (3.0, False)])
def test_noise_decides_what_is_identified(noise: float, identified: bool) -> None:
    arm = TwoLinks(length=0.5)
    motion = random_motion(arm, 200, seed=4)
    tau = arm.torque(*motion)
    model = fit(dataset_of(arm, motion, tau + noise_of(tau, noise)))
    (axis,) = axes(model)
    assert axis.identified == identified
    if identified:
        assert axis.distance_std_m is not None
        assert axis.distance_m == pytest.approx(0.5, abs=3.0 * axis.distance_std_m)


def test_a_length_elected_to_be_zero_may_be_unknown() -> None:
    """Axes that meet because nothing speaks against it; the deviation is that of no election."""
    assert Axis('wrist', 90.0, 0.0, 0.04).distance == 'not identified'
    assert Axis('wrist', 90.0, 0.0, 0.001).distance == '0.000 m (std 1.0 mm)'
    assert Axis('slider', 90.0, None, 0.001).distance == ''


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
