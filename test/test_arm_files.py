"""Parameter files of arms in config/: their settings are allowed, and both nodes have one arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from lip_id_ros.feedforward.settings import make_rules, ServeSettings
from lip_id_ros.loading import load_dataset
from lip_id_ros.recording.bag_writer import JointStateTrack, write_mcap
from lip_id_ros.settings import build, Config, override
from lip_id_ros.signals.torque_steps import LimitsFrom

CONFIG = Path(__file__).resolve().parents[1] / 'config'
ARMS = ['panda', 'ur10', 'ur3e', 'ur5e', 'fr3', 'kinova_gen3', 'kuka_lbr']


def parameters(name: str, node: str) -> dict[str, Any]:
    content = yaml.safe_load((CONFIG / f'{name}.yaml').read_text())
    return dict(content[f'/**/{node}']['ros__parameters'])


@pytest.mark.parametrize('name', ARMS)
def test_both_nodes_of_an_arm(name: str) -> None:
    recording = parameters(name, 'train')['recording']
    settings = build(ServeSettings, parameters(name, 'serve'), 'serve', name)
    assert settings.joints == tuple(recording['joints'])
    rules = make_rules(settings, settings.joints)
    assert np.isfinite(rules.limits).all()
    assert bool(settings.torque_limits) == (settings.torque_limits_from == LimitsFrom.PARAMETERS)
    assert set(parameters(name, 'train')) == {'recording'}
    config = override(Config(), {f'recording.{k}': v for k, v in recording.items()}, name)
    assert config.recording.joints == settings.joints


@pytest.mark.parametrize('name', ARMS)
def test_no_joint_is_stronger_than_those_before_it(name: str) -> None:
    limits = parameters(name, 'serve').get('torque_limits', [])
    assert (np.diff(limits) <= 0.0).all()


@pytest.mark.parametrize('name', ARMS)
def test_a_recording_of_the_driver(name: str, tmp_path: Path) -> None:
    """Drivers sort joints by name, and grippers are among them."""
    recording = parameters(name, 'train')['recording']
    config = override(Config(), {f'recording.{k}': v for k, v in recording.items()}, name)
    joints = recording['joints']
    t = np.arange(0.0, 10.0, 0.01)
    order = sorted([*joints, 'finger_joint'])
    place = np.array([joints.index(each) if each in joints else 9 for each in order], float)
    q = np.sin(t[:, np.newaxis] + place)
    bag = str(tmp_path / 'bag.mcap')
    track = JointStateTrack('/joint_states', order, t, q, np.cos(t[:, np.newaxis] + place), q)
    write_mcap(bag, [track])
    data = load_dataset([bag], config)
    assert data.joint_names == tuple(joints)
    first = data.t[0]
    np.testing.assert_allclose(data.q[0], np.sin(first + np.arange(len(joints))), atol=0.05)


@pytest.mark.parametrize(('name', 'arm'), [('controllers', 'panda'), ('controllers_ur', 'ur5e')])
def test_controllers_run_at_the_rate_of_the_driver(name: str, arm: str) -> None:
    page = (CONFIG.parent / 'docs/how-to/drivers.md').read_text()
    (row,) = [line for line in page.splitlines() if f'/{arm}.yaml)' in line]
    rate = float(row.split('|')[-2].replace('Hz', '').replace('k', 'e3').replace(' ', ''))
    controllers = yaml.safe_load((CONFIG / f'{name}.yaml').read_text())
    assert controllers['controller_manager']['ros__parameters']['update_rate'] == rate
