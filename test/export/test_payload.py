"""A payload in a model, in a flange's frame, and as `lip_id payload` writes it."""

from __future__ import annotations

from dataclasses import replace
import json
from pathlib import Path

from export.arms import model_of, random_arm, residual_gp_of
from identification.test_payload import body, NOISE, recorded
from model.models import torque_of_processes
import numpy as np
import pytest
import yaml

from lip_id_ros.arrays import Array
from lip_id_ros.cli import main
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.robot import moved
from lip_id_ros.description.urdf import load_description
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.payload import attached, mass_cautions, payload_in_flange
from lip_id_ros.friction.dahl_friction import DahlFriction
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.identification.payload import LoadedArm
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body.denavit_hartenberg import with_standard_frames
from lip_id_ros.rigid_body.regressor import torque_regressor

DOCS = Path(__file__).resolve().parents[2] / 'docs'
KINDS = 'RRRRRR'
N = len(KINDS)


def arm() -> ArmDescription:
    described = random_arm(KINDS, seed=5)
    coefficients = 0.1 * described.friction.coefficients
    return replace(described, friction=FrictionModel(described.friction.basis, coefficients))


def motion() -> Dataset:
    return recorded(arm(), body(), 0, NOISE).select(np.arange(0, 1000, 3))


def known(point: Array | None = None) -> LoadedArm:
    described = model_of(arm())
    assert described.arm is not None
    rng = np.random.default_rng(0)
    root = np.zeros((len(described.arm.covariance_root), 10))
    own = replace(described.arm, covariance_root=root)
    return LoadedArm(own, body() if point is None else point, 1e-3 * rng.standard_normal((10, 10)))


def test_the_model_has_the_payload() -> None:
    before, loaded = model_of(arm()), known()
    after = attached(before, loaded)
    q, dq, ddq = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 10, N))
    assert before.arm is not None
    columns = torque_regressor(before.arm.chain, q, dq, ddq)[:, :, -11:-1]
    added = after.inertia_matrix(q) - before.inertia_matrix(q)
    still = np.zeros_like(q)
    inertial = columns - torque_regressor(before.arm.chain, q, dq, still)[:, :, -11:-1]
    expected = inertial @ body()
    np.testing.assert_allclose(np.einsum('tij,tj->ti', added, ddq), expected, atol=1e-10)
    std = after.predict(q, dq, ddq, return_std=True).std
    assert std is not None
    assert after.arm is not None
    links = torque_regressor(after.arm.chain, q, dq, ddq) @ after.arm.links.ravel()
    rows = columns @ loaded.body_root
    friction = after.arm.friction
    slopes = friction.load_slopes(q, dq, ddq, links)
    rows += slopes @ rows
    none = np.zeros(dq.shape[1], dtype=bool)
    unknown = DahlFriction.of(after.arm.friction, none).single_std(dq, ddq)
    expected = np.hypot(np.linalg.norm(rows, axis=2), unknown)
    np.testing.assert_allclose(std.tau, expected, rtol=1e-3)


@pytest.mark.parametrize(
    ('mass', 'std', 'caution'),
    [
        *((1.0, 10.0, 'The mass is not identified'), (0.3, 0.2, 'The mass is not identified')),
        *((1.0, 0.4, ''), (0.015, 0.01, 'No payload is found')),
        *((0.001, 0.01, 'No payload is found'), (0.025, 0.01, '')),
    ],
)
def test_a_mass_that_is_not_identified_or_zero_is_a_caution(
    mass: float, std: float, caution: str
) -> None:
    found = mass_cautions(mass, std)
    assert [each.split(':')[0] for each in found] == [caution] * bool(caution)


def test_the_frame_of_the_flange() -> None:
    """A point mass 0.1 m beyond the flange's origin, turned with it."""
    chain = known().arm.chain
    point = np.array([2.0, *(2.0 * np.array([0.0, 0.1, 0.3])), *np.zeros(6)])
    c = point[1:4] / 2.0
    inertia = 2.0 * (c @ c * np.eye(3) - np.outer(c, c))
    point[4:] = inertia[np.triu_indices(3)]
    links = np.zeros((N, 11))
    links[-1, :10] = point
    standard = with_standard_frames(chain, links)[1][-1]
    found = payload_in_flange(known(point), 0.0, 0.0)
    np.testing.assert_allclose(found.parameters, standard[:10], atol=1e-12)
    x, y, z = found.centre
    turned = payload_in_flange(known(point), 0.2, 90.0)
    np.testing.assert_allclose(turned.centre, [y, -x, z - 0.2], atol=1e-12)
    np.testing.assert_allclose(turned.inertia, 0.0, atol=1e-12)
    assert turned.mass == pytest.approx(2.0)


UR = tuple(f'{name}_joint' for name in ('shoulder_pan', 'shoulder_lift', 'elbow', 'wrist_1',
                                        'wrist_2', 'wrist_3'))  # fmt: skip
PANDA = tuple(f'panda_joint{i + 1}' for i in range(7))


@pytest.mark.parametrize(
    ('urdf', 'joints', 'link', 'flange'),
    [
        ('panda', PANDA, 'panda_link8', '0.107,0'),
        ('panda', PANDA, 'panda_hand', '0.107,-45'),
        ('ur10_robot', UR, 'tool0', '0.0922,180'),
        ('ur5_robot', UR, 'tool0', '0.0823,180'),
    ],
)
def test_flanges_of_the_documentation(
    urdf: str, joints: tuple[str, ...], link: str, flange: str, shared_data: Path
) -> None:
    """A payload is found where it lies in that link's frame."""
    path = shared_data / 'urdf' / f'{urdf}.urdf'
    described = load_description(path, joints, ('revolute',) * len(joints))
    tool = next(each for each in described.bodies[-1] if each.name == link)
    centre = np.array([0.01, 0.02, 0.03])
    steiner = centre @ centre * np.eye(3) - np.outer(centre, centre)
    own = np.array([1.0, *centre, *steiner[np.triu_indices(3)]])
    posterior = known().arm
    arm = replace(
        posterior,
        chain=described.chain,
        links=described.links,
        covariance_root=np.zeros((17 * len(joints), 1)),
    )
    loaded = LoadedArm(arm, moved(own, tool.placement), np.zeros((10, 1)))
    found = payload_in_flange(loaded, *(float(x) for x in flange.split(',')))
    np.testing.assert_allclose(found.centre, centre, atol=1e-6)
    assert f'`{flange}`' in (DOCS / 'how-to' / 'payloads.md').read_text()


def test_where_the_last_frame_is_counts_in_the_deviations() -> None:
    """A last axis that may be shifted along the axis before it: so may the centre."""
    loaded, shift = known(), 0.01
    root = np.zeros_like(loaded.arm.covariance_root)
    root[6 * (N - 1) + 3 : 6 * N, 0] = shift * np.array([1.0, 0.0, 0.0])
    uncertain = replace(loaded, arm=replace(loaded.arm, covariance_root=root))
    certain = replace(loaded, body_root=0.0 * loaded.body_root)
    both = replace(uncertain, body_root=certain.body_root)
    assert payload_in_flange(certain, 0.0, 0.0).centre_std.max() == 0.0
    elsewhere = replace(
        both.arm,
        chain=both.arm.chain._replace(
            translations=both.arm.chain.translations + root[: 6 * N, 0].reshape(N, 6)[:, 3:]
        ),
    )
    change = payload_in_flange(replace(both, arm=elsewhere), 0.0, 0.0).centre
    change -= payload_in_flange(both, 0.0, 0.0).centre
    np.testing.assert_allclose(
        payload_in_flange(both, 0.0, 0.0).centre_std, np.abs(change), atol=0.05 * shift
    )


@pytest.mark.slow
def test_the_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    motion().save(tmp_path / 'run.npz')
    model_of(arm()).save(tmp_path / 'arm.npz')
    files = ['--yaml', str(tmp_path / 'load.yaml'), '-o', str(tmp_path / 'loaded.npz')]
    assert main(['payload', str(tmp_path / 'arm.npz'), str(tmp_path / 'run.npz'), *files]) == 0
    shown = ' '.join(capsys.readouterr().out.split())
    assert 'mass' in shown
    assert 'Standard deviations are too small' not in shown  # with the payload they are not
    content = yaml.safe_load((tmp_path / 'load.yaml').read_text())
    assert content['mass'] == pytest.approx(1.0, rel=0.01)
    franka, ur = content['franka_set_load'], content['ur_set_payload']
    inertia = content['inertia_about_centre_of_mass']
    assert franka['mass'] == ur['mass'] == content['mass']
    assert [*ur['center_of_gravity'].values()] == franka['center_of_mass']
    assert franka['center_of_mass'] == content['centre_of_mass']
    for axis, *of_axis in zip(
        'xyz', content['centre_of_mass'], content['centre_of_mass_std'], strict=True
    ):
        value, std = (f'{each:.4f} m' for each in of_axis)
        assert f'centre of mass, {axis} │ {value} │ {std} │' in shown
    np.testing.assert_array_equal(
        np.reshape(franka['load_inertia'], (3, 3)),
        [[inertia[x] for x in row] for row in (('xx', 'xy', 'xz'), ('xy', 'yy', 'yz'),
                                               ('xz', 'yz', 'zz'))],
    )  # fmt: skip
    assert all(ur[f'i{name}'] == value for name, value in inertia.items())
    function, arguments = content['ur_script'].split('(', 1)
    assert function == 'set_target_payload'
    order = ['mass', *['ixx', 'iyy', 'izz', 'ixy', 'ixz', 'iyz']]
    mass, centre, six = json.loads(f'[{arguments.removesuffix(")")}]')
    assert [mass, *six] == [ur[name] for name in order]
    assert centre == content['centre_of_mass']
    loaded = InverseDynamicsModel.load(tmp_path / 'loaded.npz')
    data = motion()
    residual = loaded.predict(data.q, data.dq, data.ddq).tau - data.tau
    assert np.sqrt(np.mean(residual**2)) < 1.1 * NOISE
    assert main(['payload', str(tmp_path / 'loaded.npz'), str(tmp_path / 'run.npz')]) == 0


def test_processes_of_a_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Those beside links stay; where they stand instead of links, the links bear the payload."""
    motion().save(tmp_path / 'run.npz')
    files = [str(tmp_path / 'arm.npz'), str(tmp_path / 'run.npz')]
    # beside the links of the first joint, instead at the second
    residual_gp = residual_gp_of(arm())
    model = replace(model_of(arm()), residual_gp=residual_gp)
    model.save(files[0])
    assert main(['payload', *files, '-o', str(tmp_path / 'loaded.npz')]) == 0
    said = ' '.join(capsys.readouterr().out.split())
    assert 'beside the links at joint_1 were learned without the payload' in said
    assert 'in place of the links at joint_2 would not bear the payload' in said
    loaded = InverseDynamicsModel.load(tmp_path / 'loaded.npz')
    assert loaded.residual_gp is not None
    assert loaded.arm is not None
    assert loaded.residual_gp.joints.tolist() == [True, *[False] * 5]
    assert not loaded.residual_gp.replaces.any()
    q, dq, ddq = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 10, N))
    links = loaded.arm.torque(q, dq, ddq)
    found = loaded.predict(q, dq, ddq).tau - links
    expected = np.where(np.arange(N) == 0, torque_of_processes(residual_gp, q, dq, ddq), 0.0)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())
    only = replace(residual_gp, replaces=residual_gp.joints)
    assert attached(replace(model, residual_gp=only), known()).residual_gp is None


@pytest.mark.slow
def test_outputs_of_the_verb(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    motion().save('run.npz')
    model_of(arm()).save('arm.npz')
    assert main(['payload', 'arm.npz', 'run.npz', '--yaml', 'both', '-o', './both']) == 1
    assert 'both and ./both are one; name another' in capfd.readouterr().err
    assert main(['payload', 'arm.npz', 'run.npz', '--yaml', 'found.yaml']) == 0
    output = capfd.readouterr().out
    found = yaml.safe_load((tmp_path / 'found.yaml').read_text())
    assert found['mass'] == pytest.approx(1.0, rel=0.01)
    assert 'mass' in output
    assert 'hardly better than the mean' not in output
    noise = 100.0 * np.random.default_rng(0).normal(size=motion().tau.shape)
    replace(motion(), tau=motion().tau + noise).save('noise.npz')
    assert main(['payload', 'arm.npz', 'noise.npz']) == 0
    assert 'predicts hardly better than the mean' in ' '.join(capfd.readouterr().out.split())


@pytest.mark.parametrize('text', ['1', '1,2,3', 'a,b', 'nan,0', '0,inf', '11,0', '0,1e300'])
def test_a_flange_is_two_numbers(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(['payload', 'arm.npz', 'bag', '--flange', text])
    assert 'with a comma between them were expected' in capsys.readouterr().err
