"""What CONTRIBUTING.md says of the code is so, and what it asks of a newcomer is checked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
import re
from typing import Any

from nodes import toy
import pytest

from lip_id_ros.acquisition.recorder import Recorder
from lip_id_ros.control.computed_torque import ControlSettings, PlanController
from lip_id_ros.feedforward.server import Server
from lip_id_ros.monitoring.monitor import Monitor, MonitorSettings

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'lip_id_ros'
PAGE = (ROOT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
INTERFACES = (ROOT / 'docs' / 'interfaces.md').read_text(encoding='utf-8')


def test_every_path_exists() -> None:
    quoted = re.findall(r'`([\w./]*/[\w./]*)`', PAGE)
    own = [path for path in quoted if not path.startswith(('..', '.ci', 'shared'))]
    assert len(own) > 40
    missing = [p for p in own if not (PACKAGE / p).exists() and not (ROOT / p).exists()]
    assert not missing


def test_the_table_of_rooms_has_them_all() -> None:
    table, _, _ = PAGE.partition('## Where to add')
    rows = ' '.join(line.split('|')[1] for line in table.splitlines() if line.startswith('| `'))
    rooms = {path.stem for path in PACKAGE.iterdir() if path.suffix in ('', '.py')}
    assert rooms - {'__init__', '__pycache__'} == set(re.findall(r'`(\w+)/?`', rows))


def of_monitor(folder: Path) -> Mapping[str, Any]:
    path = folder / 'model.npz'
    toy.model().save(path)
    return Monitor(MonitorSettings(model_path=str(path))).values()


def of_controller(_: Path) -> Mapping[str, Any]:
    settings = ControlSettings(joints=('a',), stiffness=(1.0,), damping=(1.0,))
    return PlanController(settings).status().values


STATUSES: Mapping[str, Callable[[Path], Mapping[str, Any]]] = {
    'serve': lambda _: Server().values(),
    'train': lambda _: Recorder((), 1).status(),
    'monitor': of_monitor,
    'computed_torque': of_controller,
}


@pytest.mark.parametrize('node', STATUSES)
def test_every_key_of_a_status_is_described(node: str, tmp_path: Path) -> None:
    _, _, section = INTERFACES.partition(f'### `ros2 run lip_id_ros {node}`\n')
    words = set(re.findall(r'\w+', section.partition('\n### ')[0]))
    missing = set(STATUSES[node](tmp_path)) - words
    assert not missing, f'describe {missing} of ~/status in docs/interfaces.md'
