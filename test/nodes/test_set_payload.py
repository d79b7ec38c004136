"""The program that gives a payload to a driver's service."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
import yaml

pytest.importorskip('rclpy', reason='needs ROS 2')

from sensor_msgs.srv import SetCameraInfo

from lip_id_ros.export.payload import to_yaml
from lip_id_ros.identification.payload import Payload
from lip_id_ros.nodes import set_payload
from lip_id_ros.nodes.set_payload import Driver, DRIVERS, Values

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = pytest.mark.ros

FRANKA = 'float64 mass\nfloat64[3] center_of_mass\nfloat64[9] load_inertia'
UR_OLD = 'float32 mass\ngeometry_msgs/Vector3 center_of_gravity'
SIX = '\n'.join(f'float64 i{name}' for name in ('xx', 'yy', 'zz', 'xy', 'xz', 'yz'))
UR = f'{UR_OLD}\n{SIX}\nbuiltin_interfaces/Duration transition_time'
UR_NEXT = 'geometry_msgs/Inertia payload\nfloat64 transition_time'


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Write two kilograms with an inertia about their centre."""
    centre = np.array([0.01, 0.02, 0.03])
    about = np.array([[0.04, 0.001, 0.002], [0.001, 0.05, 0.003], [0.002, 0.003, 0.06]])
    steiner = 2.0 * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    moments = (about + steiner)[np.triu_indices(3)]
    payload = Payload(np.concatenate([[2.0], 2.0 * centre, moments]), np.zeros((10, 10)))
    (tmp_path / 'load.yaml').write_text(to_yaml(payload, ['bag'], (0.0, 0.0)))
    return tmp_path / 'load.yaml'


def received(definition: str, driver: str, path: Path) -> Any:
    """Return a request of a definition as the other side has it, by CDR."""
    store, name = get_typestore(Stores.ROS2_JAZZY), 'some_msgs/msg/Request'
    store.register(get_types_from_msg(definition, name))
    kind = store.types[name]
    fields = list(kind.__dataclass_fields__)  # type: ignore[attr-defined]
    values = DRIVERS[driver].request(set_payload.read_payload(str(path)), fields)
    assert set(values) <= set(fields)

    def made(kind: Any, values: Mapping[str, Any]) -> Any:
        filled = {}
        for field in kind.__dataclass_fields__.values():
            if field.name.startswith('__'):
                continue
            value = values.get(field.name, 0.0)
            if field.name in ('center_of_gravity', 'com'):
                value = made(store.types['geometry_msgs/msg/Vector3'], value)
            elif field.name == 'payload':
                value = made(store.types['geometry_msgs/msg/Inertia'], value)
            elif field.name == 'transition_time' and definition is UR:
                value = store.types['builtin_interfaces/msg/Duration'](0, 0)
            filled[field.name] = np.array(value) if isinstance(value, list) else value
        assert set(values) <= set(filled)
        return kind(**filled)

    return store.deserialize_cdr(store.serialize_cdr(made(kind, values), name), name)


def entries(request: Any) -> list[float]:
    return [getattr(request, f'i{name}') for name in ('xx', 'yy', 'zz', 'xy', 'xz', 'yz')]


INERTIA = [0.04, 0.05, 0.06, 0.001, 0.002, 0.003]


def test_requests_of_each_definition(path: Path) -> None:
    franka = received(FRANKA, 'franka', path)
    assert franka.mass == 2.0
    np.testing.assert_allclose(franka.center_of_mass, [0.01, 0.02, 0.03])
    np.testing.assert_allclose(franka.load_inertia[[0, 4, 8, 1, 2, 5]], INERTIA)
    old, ur = received(UR_OLD, 'ur', path), received(UR, 'ur', path)
    for each in (old, ur):
        centre = each.center_of_gravity
        np.testing.assert_allclose(
            [each.mass, centre.x, centre.y, centre.z], [2, 0.01, 0.02, 0.03]
        )
    np.testing.assert_allclose(entries(ur), INERTIA)
    following = received(UR_NEXT, 'ur', path).payload
    centre = following.com
    np.testing.assert_allclose([following.m, centre.x, centre.y, centre.z], [2, 0.01, 0.02, 0.03])
    np.testing.assert_allclose(entries(following), INERTIA)


@pytest.mark.parametrize(
    ('mass', 'std', 'caution'),
    [
        (-1.0, 0.01, 'No payload is found'),
        (0.01, 0.01, 'No payload is found'),
        (1.0, 0.6, 'The mass is not identified'),
    ],
)
def test_a_payload_that_is_not_known_is_not_sent(
    path: Path, capfd: pytest.CaptureFixture[str], mass: float, std: float, caution: str
) -> None:
    text = path.read_text().replace('mass: 2.0', f'mass: {mass}')
    path.write_text(text.replace('mass_std: 0.0', f'mass_std: {std}'))
    assert set_payload.main([str(path), 'franka']) == 1
    said = capfd.readouterr().err
    assert f'load.yaml is not given to a robot. {caution}' in said


@pytest.mark.parametrize(
    ('entry', 'instead'),
    [
        ('mass: 2.0', 'mass: NaN'),
        ('franka_set_load: {"mass": 2.0', 'franka_set_load: {"mass": [null]'),
        ('ur_set_payload: {"mass": 2.0', 'ur_set_payload: {"mass": Infinity'),
    ],
)
def test_a_payload_with_what_is_no_number_is_refused(
    path: Path, capfd: pytest.CaptureFixture[str], entry: str, instead: str
) -> None:
    text = path.read_text()
    assert entry in text
    path.write_text(text.replace(entry, instead))
    assert set_payload.main([str(path), 'franka']) == 1
    assert 'load.yaml must be what lip_id payload --yaml wrote' in capfd.readouterr().err


def camera(payload: Values, fields: Collection[str]) -> Values:
    """A service of the tests' Jazzy that takes three numbers and a matrix."""
    assert list(fields) == ['camera_info']
    load = payload['franka_set_load']
    return {'camera_info': {'d': load['center_of_mass'], 'k': load['load_inertia']}}


@pytest.mark.parametrize('success', [True, False])
def test_a_service_is_called(
    ros: Ros,
    path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    success: bool,
) -> None:
    graph, client = ros
    requests: list[Any] = []

    def answer(request: Any, response: Any) -> Any:
        requests.append(request)
        response.success = success
        return response

    client.node.create_service(SetCameraInfo, '/arm/set_load', answer)
    driver = Driver('sensor_msgs/srv/SetCameraInfo', '/elsewhere', camera)
    monkeypatch.setitem(set_payload.DRIVERS, 'franka', driver)
    monkeypatch.setenv('ROS_DOMAIN_ID', str(graph.domain))
    found = set_payload.main([str(path), 'franka', '--service', '/arm/set_load'])
    said = capfd.readouterr().err
    assert found == 1 - success
    assert ('/arm/set_load has set the payload: 2 kg' in said) == success
    assert ('has not set the payload: see its log' in said) != success
    (request,) = requests
    load = yaml.safe_load(path.read_text())['franka_set_load']
    np.testing.assert_array_equal(request.camera_info.d, load['center_of_mass'])
    np.testing.assert_array_equal(request.camera_info.k, load['load_inertia'])


def test_what_is_absent_is_named(
    path: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    missing = Driver('no_such_msgs/srv/SetLoad', '/nobody', camera)
    monkeypatch.setitem(set_payload.DRIVERS, 'ur', missing)
    assert set_payload.main([str(path), 'ur']) == 1
    said = capfd.readouterr().err
    assert 'but no_such_msgs is not installed or too old' in said
    assert 'ros-$ROS_DISTRO-no-such-msgs' in said
    (tmp_path / 'other.yaml').write_text('mass: 1.0\n')
    assert set_payload.main([str(tmp_path / 'other.yaml'), 'ur']) == 1
    assert 'other.yaml must be what lip_id payload --yaml wrote' in capfd.readouterr().err
    monkeypatch.setattr(set_payload, 'LONGEST_S', 0.2)
    driver = Driver('sensor_msgs/srv/SetCameraInfo', '/nobody', camera)
    monkeypatch.setitem(set_payload.DRIVERS, 'ur', driver)
    assert set_payload.main([str(path), 'ur']) == 1
    assert '/nobody is offered by nobody; start the driver' in capfd.readouterr().err
