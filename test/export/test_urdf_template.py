"""What was fitted, in the user's own URDF: the right numbers, and no other byte changed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import re

from export.arms import describe, every_friction, model_of
from export.readers import difference, of_template
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lip_id_ros.cli import main
from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.description.urdf import load_description
from lip_id_ros.export.arm import ArmDescription, Exported
from lip_id_ros.export.formats import formatted, Template
from lip_id_ros.export.urdf_template import fill_template, template_remarks
from lip_id_ros.friction.basis import plain_friction
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body.pseudo_inertia import pseudo_inertia

TIAGO = ('torso_lift_joint', *(f'arm_{i}_joint' for i in range(1, 8)))
ARMS = {
    'panda.urdf': (tuple(f'panda_joint{i}' for i in range(1, 8)), ['revolute'] * 7),
    'tiago_no_hand.urdf': (TIAGO, ['prismatic', *['revolute'] * 7]),
}
WRITTEN = (
    r'<(inertia|mass|dynamics)\b[^>]*?/>',
    r'(?<=<inertial>)\s*<origin\b[^>]*?/>',
)


def described(name: str, shared_data: Path) -> RobotDescription:
    return load_description(shared_data / 'urdf' / name, *ARMS[name])


def fitted(description: RobotDescription, seed: int = 0) -> ArmDescription:
    """Return an arm near a description, with rotors and friction, in the description's frames."""
    rng = np.random.default_rng(seed)
    chain, links = description.chain, description.links
    n = len(links)
    turn = Rotation.from_rotvec(0.02 * rng.standard_normal((n, 3))).as_matrix()
    chain = chain._replace(
        rotations=np.ascontiguousarray(chain.rotations @ turn),
        translations=chain.translations + 0.005 * rng.standard_normal((n, 3)),
    )
    links = links * rng.uniform(0.9, 1.2, (n, 1)) + 1e-3 * np.eye(11)[0]
    links[:, 4:10] += 1e-3 * np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])
    links[:, 10] = 0.1
    arm = describe('arm', chain, links)
    return replace(arm, chain=chain, links=links, joint_names=description.joint_names)


def without(text: str, *patterns: str) -> str:
    for pattern in patterns:
        text = re.sub(pattern, '', text)
    return re.sub(r'\s+', ' ', text)


@pytest.mark.parametrize('name', ARMS)
def test_other_programs_read_what_was_fitted(name: str, shared_data: Path) -> None:
    pytest.importorskip('pinocchio')
    description = described(name, shared_data)
    arm = fitted(description)
    text = fill_template(arm, description, origins=True)
    states = np.random.default_rng(0).uniform(-1.5, 1.5, (3, 200, arm.n_joints))
    assert difference('urdf', text, arm, states, arm.torque(*states), of_template) < 1e-9


@pytest.mark.parametrize('name', ARMS)
def test_nothing_else_changes(name: str, shared_data: Path) -> None:
    description = described(name, shared_data)
    arm = fitted(description)
    before, after = description.text, fill_template(arm, description, origins=False)
    assert before != after
    assert without(before, *WRITTEN) == without(after, *WRITTEN)
    changed = [a != b for a, b in zip(before.splitlines(), after.splitlines(), strict=True)]
    moving = sum(len(bodies) for bodies in description.bodies)
    assert 0 < sum(changed) <= 3 * moving + arm.n_joints
    again = load_description(after, description.joint_names, description.joint_types)
    assert again.fingerprint == description.fingerprint
    np.testing.assert_allclose(again.links[:, :10], arm.links[:, :10], rtol=1e-9, atol=1e-12)
    origins = load_description(
        fill_template(arm, description, origins=True), again.joint_names, again.joint_types
    )
    np.testing.assert_allclose(origins.chain.rotations, arm.chain.rotations, atol=1e-12)
    np.testing.assert_allclose(origins.chain.translations, arm.chain.translations, atol=1e-12)


def test_what_was_there_already_stays_byte_for_byte(shared_data: Path) -> None:
    description = described('panda.urdf', shared_data)
    n = len(description.joint_names)
    basis = plain_friction(n, np.full(n, 0.05))
    plain = np.column_stack([description.damping, description.friction, np.zeros(n)]).ravel()
    arm = replace(
        fitted(description),
        chain=description.chain,
        links=description.links,
        friction=FrictionModel(basis, plain),
    )
    text = fill_template(arm, description, origins=False)
    changed = [
        (a, b)
        for a, b in zip(description.text.splitlines(), text.splitlines(), strict=True)
        if a != b
    ]
    for a, b in changed:  # rounding of inertials about other points
        numbers = [[float(x) for x in re.findall(r'[-\d.e]+(?=[" ])', line)] for line in (a, b)]
        np.testing.assert_allclose(numbers[0], numbers[1], rtol=1e-9, atol=1e-12)


def test_what_is_fixed_to_a_link_gives_way_where_it_must() -> None:
    """A tool that is heavier than all that was found."""
    urdf = """<robot name="x"><link name="base"/><link name='a'/>
      <link name="tool"><inertial><origin xyz="0 0 0.1"/><mass value="4"/>
        <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
      <joint name="j" type="continuous"><parent link="base"/><child link="a"/></joint>
      <joint name="f" type="fixed"><parent link="a"/><child link="tool"/></joint></robot>"""
    description = load_description(urdf, ('j',), ('revolute',))
    arm = fitted(description)
    links = arm.links.copy()
    links[0, :10] = 0.3 * description.links[0, :10]
    links[0, 4:10] += 1e-3 * np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])
    text = fill_template(replace(arm, links=links), description, origins=True)
    again = load_description(text, ('j',), ('revolute',))
    np.testing.assert_allclose(again.links[0, :10], links[0, :10], atol=1e-12)
    masses = [body.parameters[0] for body in again.bodies[0]]
    assert masses[1] == 1.0
    for body in again.bodies[0]:
        assert np.linalg.eigvalsh(pseudo_inertia(body.parameters))[0] > 0.0
    assert '<dynamics damping=' in text


def test_the_verb(shared_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    description = described('panda.urdf', shared_data)
    arm = fitted(description)
    model, target = tmp_path / 'arm.npz', tmp_path / 'fitted.urdf'
    known = {'description': {'fingerprint': description.fingerprint}}
    replace(model_of(arm), summary=known).save(model)
    template = ['--urdf', str(target), '--template', str(shared_data / 'urdf' / 'panda.urdf')]
    assert main(['export', str(model), *template]) == 0
    said = ' '.join(capsys.readouterr().out.split())
    assert 'which are kept; add --origins' in said
    assert 'Left out, since URDF cannot express it: ' in said
    assert 'Gravity is 0 0 -9.80665 m/s^2' in said
    assert 'set them where you load it, as armature: panda_joint1 0.1' in said
    assert main(['export', str(model), *template, '--origins']) == 0
    assert '--origins' not in capsys.readouterr().out
    replace(model_of(arm), summary={}).save(model)
    assert main(['export', str(model), *template, '--force']) == 1
    assert 'but this one was fitted without one; fit again' in capsys.readouterr().err
    assert main(['export', str(model), *template[2:]]) == 1
    assert main(['export', str(model), '--urdf', 'x.urdf', '--origins']) == 1


def test_a_filled_file_is_filled_again(
    shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its last comment is renewed; another URDF is not replaced unasked."""
    monkeypatch.chdir(tmp_path)
    text = described('panda.urdf', shared_data).text
    Path('first.urdf').write_text(text)
    known = described('panda.urdf', shared_data)
    summary = {'description': {'fingerprint': known.fingerprint}}
    replace(model_of(fitted(known)), summary=summary).save('arm.npz')
    fill = ['export', 'arm.npz', '--urdf', 'filled.urdf', '--template']
    assert main([*fill, 'first.urdf']) == 0
    once = Path('filled.urdf').read_text()
    assert once.count('identified by lip_id_ros') == 1
    assert 'Gravity is 0 0 -9.80665 m/s^2' in once[once.index('</robot>') :]
    assert main([*fill, 'first.urdf']) == 0
    assert main(['export', 'arm.npz', '--urdf', 'again.urdf', '--template', 'filled.urdf']) == 0
    assert Path('again.urdf').read_text() == once == Path('filled.urdf').read_text()
    Path('filled.urdf').write_text(text)
    assert main([*fill, 'first.urdf']) == 1
    assert Path('filled.urdf').read_text() == text


def test_remarks_name_friction_that_urdf_cannot_express(shared_data: Path) -> None:
    description = described('panda.urdf', shared_data)
    n = len(description.joint_names)
    friction = every_friction(n, np.random.default_rng(0))
    arm = replace(fitted(description), friction=friction)
    file = formatted('urdf', Exported(arm, arm, None), Template(description, origins=True))
    assert 'Stribeck (' in ' '.join(file.left_out)
    remarks = template_remarks(arm, description, origins=True)
    assert not any('--origins' in remark for remark in remarks)


def test_models_keep_the_fingerprint(tmp_path: Path, shared_data: Path) -> None:
    description = described('panda.urdf', shared_data)
    known = {'description': {'fingerprint': description.fingerprint}}
    replace(model_of(fitted(description)), summary=known).save(tmp_path / 'arm.npz')
    loaded = InverseDynamicsModel.load(tmp_path / 'arm.npz')
    assert loaded.summary['description']['fingerprint'] == description.fingerprint
