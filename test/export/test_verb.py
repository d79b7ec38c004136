"""`lip_id export` on fitted models, and what it refuses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import shutil
import subprocess

from evaluation.models import small_model
from export.arms import model_of, random_arm, residual_gp_of
from export.readers import difference, states_of
import numpy as np
import pytest
from simulation.panda_runs import runs

from benchmarks._arms import JointFriction
from lip_id_ros.cli import main
from lip_id_ros.export.arm import describe
from lip_id_ros.export.c_header import to_c_header
from lip_id_ros.friction.basis import FrictionBasis, plain_friction
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.identification import fit
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.effort_calibration import EffortCalibration

pytest.importorskip('pinocchio')
pytest.importorskip('mujoco')
NEEDS_CC = pytest.mark.skipif(shutil.which('cc') is None, reason='needs a C compiler')
EXAMPLE = Path(__file__).resolve().parents[2] / 'docs' / 'examples' / 'computed_torque.c'


@pytest.fixture(scope='module')
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    friction = JointFriction(np.full(3, 0.5), np.full(3, 0.3), 0.05)
    training, _ = runs(3, 200, friction, noise=0.01)
    path = tmp_path_factory.mktemp('export') / 'panda3.npz'
    fit(training).save(path)
    return path


@pytest.mark.slow
@NEEDS_CC
def test_all_formats_agree_with_the_model(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    files = ('--urdf', 'a.urdf', '--mjcf', 'a.xml', '--c', 'a.h')
    assert main(['export', str(model), *files, '--name', 'a']) == 0
    known = InverseDynamicsModel.load(model)
    arm = describe(known, 'a').arm
    states = states_of(arm, 1000)
    tau = known.predict(*states).tau
    for name, path in (('urdf', 'a.urdf'), ('mjcf', 'a.xml'), ('c', 'a.h')):
        text = Path(path).read_text()
        assert difference(name, text, arm, states, tau) < 1e-9
        assert 'inverse dynamics of an arm, identified by lip_id_ros' in text
        assert 'Position ranges, velocities and efforts are those of the recordings' in text


@NEEDS_CC
@pytest.mark.parametrize('rise_time', [0.0, 0.05])
def test_the_example_controls_the_arm(rise_time: float, tmp_path: Path) -> None:
    """
    docs/examples/computed_torque.c, which fails where it does not follow.

    Friction that changes its sign within 0.005 rad/s holds an arm whose feedforward is softened as
    a low-pass softens the torques of a recording (`rise_time`).

    """
    arm = random_arm('RRR')
    plain = plain_friction(arm.n_joints, np.full(arm.n_joints, 0.005)).terms
    basis = FrictionBasis(arm.n_joints, plain, rise_time)
    friction = FrictionModel(basis, np.full(basis.size, 2.0))
    (tmp_path / 'arm.h').write_text(to_c_header(replace(arm, name='arm', friction=friction)))
    shutil.copy(EXAMPLE, tmp_path)
    strict = ('-std=c11', '-O1', '-Wall', '-Wextra', '-pedantic', '-Werror')
    command = ['cc', *strict, '-o', 'control', EXAMPLE.name, '-lm']
    built = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    ran = subprocess.run([tmp_path / 'control'], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout
    assert len(EXAMPLE.read_text().splitlines()) <= 110


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        ([], '--urdf, --mjcf or --c with a file, or --solver-package was expected, but none'),
        (['--urdf', 'no/such/arm.urdf'], 'no/such/arm.urdf cannot be written (No such file or'),
        (['--urdf', 'arm.x', '--mjcf', './arm.x'], 'but arm.x and ./arm.x are one; name another'),
        (['--urdf', 'a\0b'], "must have a name without NUL, but 'a\\x00b' came"),
        (['--c', ''], "must have a name without NUL, but '' came"),
    ],
)
def test_what_is_refused(
    model: Path,
    arguments: list[str],
    sentence: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(['export', str(model), *arguments]) == 1
    assert sentence in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_template_is_never_replaced(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    urdf = str(tmp_path / 'arm.urdf')
    assert main(['export', str(model), '--urdf', urdf]) == 0
    before = (tmp_path / 'arm.urdf').read_bytes()
    assert main(['export', str(model), '--urdf', urdf, '--template', urdf]) == 1
    assert 'arm.urdf is an input and would be replaced' in capsys.readouterr().err
    assert (tmp_path / 'arm.urdf').read_bytes() == before


def test_a_model_without_links_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'pendulums.npz'
    small_model().save(path)
    assert main(['export', str(path), '--urdf', str(tmp_path / 'a.urdf')]) == 1
    assert 'rigid links were expected, but the model has the kernel' in capsys.readouterr().err
    assert not (tmp_path / 'a.urdf').exists()


def test_files_say_what_they_stand_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    described = random_arm('RR')
    chain = described.chain._replace(gravity=np.zeros(3))
    scaled = replace(model_of(replace(described, chain=chain)), provenance={'payload_mass': 1.25})
    calibration = EffortCalibration(np.array([1.0, 12.0]), np.zeros(2))
    replace(scaled, effort_calibrations=(calibration,)).save('scaled.npz')
    model_of(described).save('plain.npz')
    formats = ('urdf', 'mjcf', 'c')
    for name in ('scaled', 'plain'):
        files = (x for form in formats for x in (f'--{form}', f'{name}.{form}'))
        assert main(['export', f'{name}.npz', *files]) == 0
    sentences = (
        'So is a payload of 1.25 kg, identified afterwards.',
        'recorded efforts times effort_scale',
        'The recorded efforts leave gravity out',
    )
    for form in formats:
        scaled_text, plain_text = (
            ' '.join(Path(f'{name}.{form}').read_text().replace(' * ', ' ').split())
            for name in ('scaled', 'plain')
        )
        for sentence in sentences:
            assert sentence in scaled_text
            assert sentence not in plain_text
        assert 'A gripper or load that the arm carried' in plain_text
    assert 'A model with a Gaussian process is not written as C.' in scaled_text


def test_a_residual_gp_is_left_out_of_urdf_and_refused_in_c(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, arm = tmp_path / 'arm.npz', random_arm('RRR')
    replace(model_of(arm), residual_gp=residual_gp_of(arm)).save(path)
    assert main(['export', str(path), '--urdf', str(tmp_path / 'a.urdf')]) == 0
    shown = ' '.join(capsys.readouterr().out.split())
    assert 'Left out: ' in shown
    assert 'beside links and friction at joint_1 and in place of links and friction' in shown
    assert 'Left out - ' in (tmp_path / 'a.urdf').read_text()
    both = '--urdf', str(tmp_path / 'b.urdf'), '--c', str(tmp_path / 'a.h')
    assert main(['export', str(path), *both]) == 1
    error = capsys.readouterr().err
    assert 'the C header has links and friction only' in error
    assert 'fit with fit.terms: named' in error
    assert not (tmp_path / 'a.h').exists()
    assert not (tmp_path / 'b.urdf').exists()  # all files or none
