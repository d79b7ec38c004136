"""Forward simulation of recorded motions, against pinocchio and against the truth."""

from __future__ import annotations

from dataclasses import replace
import json
from pathlib import Path

from cli.conftest import lip_id
from export.arms import model_of, panda
import numpy as np
import pytest

from lip_id_ros.cli import main
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.urdf import load_description
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation.rollout import (
    FEEDBACK,
    floor,
    nominal_arm,
    roll_out,
    Rollout,
    rollout_cautions,
    Rollouts,
    window_starts,
)
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.urdf import rotor_inertias, to_urdf
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel, plain_friction
from lip_id_ros.friction.terms import Lag, Presliding
from lip_id_ros.model.forward_dynamics import ForwardDynamics
from lip_id_ros.rigid_body.couplings import Coupling, coupling_matrix, rows_of
from lip_id_ros.simulation import panda as simulated_panda
from lip_id_ros.simulation import SinusoidTrajectory, write_bag
from lip_id_ros.simulation.arm import MOTION, panda_urdf

pytest.importorskip('pinocchio')
N = 7


def arm_with(coulomb: float, width: float = 0.02) -> ArmDescription:
    friction = np.tile([0.5, coulomb, 0.1], N)
    return replace(panda(), friction=FrictionModel(plain_friction(N, np.full(N, width)), friction))


def forward(arm: ArmDescription) -> ForwardDynamics:
    return ForwardDynamics(arm.chain, arm.links, arm.friction)


def recorded(arm: ArmDescription, rate: int = 200, seconds: float = 4.0) -> Dataset:
    t = np.arange(0.0, seconds, 1.0 / rate)
    motion = SinusoidTrajectory.random(MOTION, np.random.default_rng(1), 20)
    q, dq, ddq = motion.sample(t)
    names = arm.joint_names
    return Dataset(
        t=t, q=q, dq=dq, ddq=ddq, tau=arm.torque(q, dq, ddq), joint_names=names,
        joint_types=('revolute',) * N, segment=(t > 0.6 * seconds).astype(np.int64),
        provenance={'sources': ['simulation']},
    )  # fmt: skip


def test_accelerations_are_those_of_pinocchio() -> None:
    """Of the articulated-body algorithm on the exported URDF, friction added."""
    import xml.etree.ElementTree as ET

    import pinocchio

    arm = arm_with(0.3)
    text = to_urdf(arm)
    model = pinocchio.buildModelFromXML(text)
    model.gravity.linear = arm.chain.gravity
    model.armature = rotor_inertias(ET.fromstring(text), arm.joint_names)
    data = model.createData()
    q, dq, tau = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 20, N))
    found = forward(arm).acceleration(q, dq, tau, np.zeros_like(q), 1e-9)
    inner = tau - arm.friction.torque(q, dq, *np.zeros((2, *q.shape)))
    expected = [pinocchio.aba(model, data, *row) for row in zip(q, dq, inner, strict=True)]
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize('coulomb', [0.0, 0.5])
def test_the_true_arm_follows(coulomb: float) -> None:
    """Also through reversals, where friction turns within a step."""
    arm = arm_with(coulomb)
    short, long = roll_out(forward(arm), recorded(arm))
    assert (short.horizon_s, long.horizon_s) == (0.1, 1.0)
    assert (short.position < 2e-4).all()
    assert (long.position < 0.01 * long.travel.max()).all()
    assert (long.velocity < 0.02).all()


def test_the_arm_whose_torques_went_through_a_low_pass_follows() -> None:
    """Friction whose sign is sharp but for that, and what depends on accelerations, left out."""
    arm = arm_with(0.5, 1e-3)
    basis = replace(arm.friction.basis, rise_time=0.05)
    reversal = DriveTerm(Drive.of_joint(0), Presliding(0.05, 1.0))
    late = DriveTerm(Drive.of_joint(1), Lag())
    hysteresis = replace(basis, terms=(*basis.terms, reversal, late))
    smooth = replace(arm, friction=FrictionModel(basis, arm.friction.coefficients))
    coefficients = np.append(arm.friction.coefficients, [0.3, 0.3])
    whole = replace(arm, friction=FrictionModel(hysteresis, coefficients))
    data = recorded(smooth)
    short, long = roll_out(forward(smooth), data)
    assert (short.position < 4e-4).all()
    assert (long.position < 0.01 * long.travel.max()).all()
    np.testing.assert_array_equal(roll_out(forward(whole), data)[1].position, long.position)


def test_wrong_links_stray() -> None:
    arm = arm_with(0.2)
    data = recorded(arm)
    heavy = arm.links.copy()
    heavy[3, :10] *= 1.2
    right, wrong = (
        roll_out(x, data)[1] for x in (forward(arm), replace(forward(arm), links=heavy))
    )
    assert wrong.position[:4].max() > 5.0 * right.position[:4].max()


def test_errors_beyond_the_travel_are_a_caution() -> None:
    some = np.array([0.1, 0.2])
    good = Rollout(0.1, 50, position=0.1 * some, velocity=some, travel=some)
    lost = Rollout(1.0, 50, position=np.array([0.05, 0.3]), velocity=some, travel=some)
    (caution,) = rollout_cautions(Rollouts((good, lost), (good, good)), ('a', 'b'))
    begin = 'In windows of 1 s the errors of the simulated motion exceed the travel at b: '
    assert caution.startswith(begin)


def test_torques_are_those_that_give_the_accelerations() -> None:
    arm = arm_with(0.3)
    q, dq, ddq = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 20, N))
    tau = forward(arm).torque(q, dq, ddq)
    np.testing.assert_allclose(tau, arm.torque(q, dq, ddq), atol=1e-9)
    found = forward(arm).acceleration(q, dq, tau, ddq, 1e-9)
    np.testing.assert_allclose(found, ddq, rtol=1e-5, atol=1e-5)


def test_the_floor_is_the_error_of_exact_torques() -> None:
    arm = arm_with(0.2)
    data = recorded(arm)
    wrong = replace(data, tau=0.9 * data.tau)
    for some in (data, wrong):
        np.testing.assert_allclose(
            floor(forward(arm), some)[0].position, roll_out(forward(arm), data)[0].position
        )
    thinned = wrong.select(np.arange(0, data.n_samples, 16))
    few, every = (floor(forward(arm), each)[0].position for each in (thinned, wrong))
    assert float(few.max()) > 5.0 * float(every.max())


def test_no_window_bridges_a_hole() -> None:
    data = recorded(arm_with(0.2))
    holes = data.select(np.flatnonzero(data.t % 0.5 < 0.35))
    starts = window_starts(holes, 0.1)
    assert starts.size
    assert (holes.t[starts] % 0.5 < 0.25).all()
    assert window_starts(holes, 1.0).size == 0
    few = data.select(np.linspace(0, data.n_samples - 1, 30).astype(int))
    with pytest.raises(DataError, match=r'samples at most 0\.1 s apart, but there is none; .*mor'):
        roll_out(forward(arm_with(0.2)), few)


def test_windows_are_uninterrupted() -> None:
    data = recorded(arm_with(0.2))
    starts = window_starts(data, 1.0)
    ends = np.searchsorted(data.t, data.t[starts] + 1.0)
    assert starts.size == 50
    assert (data.segment[starts] == data.segment[ends]).all()
    assert window_starts(data, 100.0).size == 0


def test_too_short_a_recording_is_refused() -> None:
    arm = arm_with(0.2)
    with pytest.raises(DataError, match=r'an uninterrupted motion of at least 0\.1 s'):
        roll_out(forward(arm), recorded(arm, seconds=0.05))


def test_links_without_inertia_are_refused() -> None:
    arm = arm_with(0.2)
    nothing = replace(forward(arm), links=np.zeros_like(arm.links))
    q, dq, tau, ddq = np.zeros((4, 1, N))
    with pytest.raises(DataError, match='links with inertia were expected'):
        nothing.acceleration(q, dq, tau, ddq, 0.0)


@pytest.mark.slow
def test_the_arm_of_a_recording_follows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    arm = arm_with(0.2)
    model_of(arm).save('arm.npz')
    data = recorded(arm, seconds=8.0)
    write_bag('run', replace(data, segment=np.zeros(data.n_samples, np.int64)), start=1.7e9)
    Path('few.yaml').write_text('preprocessing: {max_samples: 150}')
    files = ['arm.npz', 'run', '--config', 'few.yaml', '--last', '0.5']
    lip_id('evaluate', *files, '--rollout', '--json', 'errors.json')
    errors = json.loads(Path('errors.json').read_text())
    assert errors['n_samples'] <= 75
    for name in ('model', 'floor'):
        short, long = errors['rollout'][name]
        assert max(short['position']) < 1e-3
        assert (short['windows'], long['windows']) == (50, 50)


@pytest.mark.slow
def test_the_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The nominal Panda, which lacks rotors and friction, strays farther than its model."""
    arm = arm_with(0.2)
    names = tuple(f'panda_joint{i + 1}' for i in range(N))
    replace(model_of(arm), joint_names=names).save(tmp_path / 'arm.npz')
    replace(recorded(arm), joint_names=names).save(tmp_path / 'run.npz')
    files = [
        str(tmp_path / 'arm.npz'),
        str(tmp_path / 'run.npz'),
        '--json',
        str(tmp_path / 'a.json'),
    ]
    report = ['--report', str(tmp_path / 'report')]
    assert main(['evaluate', *files, '--rollout', '--urdf', str(panda_urdf()), *report]) == 0
    said = ' '.join(capsys.readouterr().out.split())
    assert f'windows of 1 s, feedback of {FEEDBACK:g} rad/s' in said
    assert (tmp_path / 'report' / 'rollout.png').is_file()
    page = (tmp_path / 'report' / 'index.html').read_text()
    assert f'windows of 1 s, feedback of {FEEDBACK:g} rad/s' in page
    rollout = json.loads((tmp_path / 'a.json').read_text())['rollout']
    for ours, nominal in zip(rollout['model'], rollout['urdf'], strict=True):
        assert max(ours['position']) < max(nominal['position'])
    assert main(['evaluate', *files, '--force', '--urdf', str(panda_urdf())]) == 1
    assert '--urdf is compared by --rollout' in capsys.readouterr().err


def test_the_nominal_arm_without_gravity() -> None:
    names = tuple(f'panda_joint{i + 1}' for i in range(N))
    description = load_description(panda_urdf(), names, ('revolute',) * N)
    assert not nominal_arm(description, gravity_compensated=True).chain.gravity.any()
    assert nominal_arm(description, gravity_compensated=False).chain.gravity[2] < -9.0
    assert simulated_panda().joint_names == names


def test_the_nominal_arm_of_coupled_positions() -> None:
    names = tuple(f'panda_joint{i + 1}' for i in range(N))
    description = load_description(panda_urdf(), names, ('revolute',) * N)
    serial = nominal_arm(description, gravity_compensated=False)
    couplings = rows_of([Coupling(3, 1, -1.0)])
    coupled = nominal_arm(description, gravity_compensated=False, couplings=couplings)
    matrix = coupling_matrix(coupled.chain)
    assert matrix[3, 1] == -1.0
    q, still = np.random.default_rng(0).normal(size=(4, N)), np.zeros((4, N))
    # by virtual work, at rest
    expected = serial.torque(q @ matrix.T, still, still) @ matrix
    np.testing.assert_allclose(coupled.torque(q, still, still), expected, atol=1e-9)
