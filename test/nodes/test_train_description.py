"""Node `train` with a URDF of a topic, and the payload of an arm that it has learned."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')
pytest.importorskip('pinocchio')

import numpy as np
from simulation.panda_runs import runs
from std_msgs.msg import String
import yaml

from lip_id_ros.arrays import Array
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.nodes import qos
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.simulation.arm import panda_urdf

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = [pytest.mark.ros, pytest.mark.slow]

MASS, CENTRE = 1.0, np.array([0.0, 0.03, 0.05])


def body() -> Array:
    inertia = 1e-3 * np.eye(3) + MASS * (CENTRE @ CENTRE * np.eye(3) - np.outer(CENTRE, CENTRE))
    return np.array([MASS, *(MASS * CENTRE), *inertia[np.triu_indices(3)]])


def test_the_topic_is_the_prior_and_payloads_are_found(ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    bare, other = runs(3, 300, noise=1e-3)
    bare.save(tmp_path / 'bare.npz')
    train = graph.start('train', bags=['bare.npz'], use_robot_description=True)
    answer = client.trigger('/train/fit')
    assert not answer.success
    assert answer.message.startswith('a URDF was expected on /robot_description')
    publisher = client.speak(String, '/robot_description', qos.LATCHED)
    publisher.publish(String(data='/dev/zero'))  # must not be taken for the name of a file
    sentence = "(use_robot_description), but '/dev/zero' came; correct its publisher."
    client.wait_until(
        lambda: client.trigger('/train/fit').message.endswith(sentence), 'a refusal of the text'
    )
    publisher.publish(String(data=panda_urdf().read_text()))
    client.wait_until(lambda: client.trigger('/train/fit').success, 'a fit with the URDF')
    status = client.status('train', lambda status: status['job']['state'] in ('done', 'failed'))
    assert status['job']['state'] == 'done', train.log
    model = InverseDynamicsModel.load(tmp_path / 'model.npz')
    assert model.summary['description']['place'] == 'robot_description'
    assert model.arm is not None
    motion = other.q, other.dq, other.ddq
    added = torque_regressor(model.arm.chain, *motion)[:, :, -11:-1] @ body()
    replace(other, tau=other.tau + added).save(tmp_path / 'loaded.npz')
    client.set_parameter('train', 'bags', ['loaded.npz'])
    client.set_parameters('train', payload_model_path='with_payload.npz', payload_flange_shift=0.1)
    assert client.trigger('/train/payload').success
    status = client.status('train', lambda status: status['job']['task'] == 'payload'
                           and status['job']['state'] in ('done', 'failed'))  # fmt: skip
    assert status['job']['state'] == 'done', train.log
    content = yaml.safe_load((tmp_path / 'payload.yaml').read_text())
    assert content['flange'] == {'shift_m': 0.1, 'turn_deg': 0.0}
    loaded = InverseDynamicsModel.load(tmp_path / 'with_payload.npz')
    assert loaded.provenance['payload_mass'] == content['mass']
    # three joints hardly distinguish a mass from its place, but its torques are identified
    found = loaded.predict(*motion).tau - model.predict(*motion).tau
    np.testing.assert_allclose(found, added, atol=0.02 * np.abs(added).max())
