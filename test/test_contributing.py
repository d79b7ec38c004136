"""What CONTRIBUTING.md and the other pages say of the code is so."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
import re
import tomllib
from typing import Any

from adaptation.arms import known_model
from nodes import toy
import pytest

from lip_id_ros.acquisition.recorder import Recorder
from lip_id_ros.adaptation.live import AdaptSettings, LiveAdaptation
from lip_id_ros.feedforward.server import Server
from lip_id_ros.monitoring.monitor import Monitor
from lip_id_ros.monitoring.settings import MonitorSettings

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'lip_id_ros'
PAGE = (ROOT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
INTERFACES = (ROOT / 'docs' / 'reference' / 'interfaces.md').read_text(encoding='utf-8')


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


def quoted_names() -> Iterator[tuple[str, list[str]]]:
    """Yield pages, and dotted names on them that begin with the package."""
    for page in [*ROOT.glob('*.md'), *ROOT.glob('docs/**/*.md'), *PACKAGE.rglob('*.py')]:
        found = re.findall(r'`lip_id_ros((?:\.\w+)+)`', page.read_text(encoding='utf-8'))
        yield from ((page.name, name.split('.')[1:]) for name in found)


def defined(module: Path) -> set[str]:
    """Names that a module has at its top level."""
    names: set[str] = set()
    for node in ast.parse(module.read_text(encoding='utf-8')).body:
        names |= {alias.asname or alias.name for alias in getattr(node, 'names', ())}
        names |= {name.id for name in ast.walk(node) if isinstance(name, ast.Name)}
        names |= {getattr(node, 'name', '')}
    return names


def test_every_name_exists() -> None:
    for page, name in quoted_names():
        place = PACKAGE
        while name and (place / name[0]).is_dir():
            place /= name.pop(0)
        module = place / '__init__.py'
        if name and (place / f'{name[0]}.py').exists():
            module = place / f'{name.pop(0)}.py'
        assert not name or name[0] in defined(module), f'{page}: {name[0]} is not in {module}'


def of_monitor(factory: pytest.TempPathFactory) -> Mapping[str, Any]:
    return Monitor(MonitorSettings(model_path=toy.model_path(factory))).values()


def of_adapt(factory: pytest.TempPathFactory) -> Mapping[str, Any]:
    path = factory.mktemp('adapt') / 'arm.npz'
    known_model().save(path)
    return LiveAdaptation(AdaptSettings(model_path=str(path)), '/adapt', 0.0, 0.0).values()


STATUSES: Mapping[str, Callable[[pytest.TempPathFactory], Mapping[str, Any]]] = {
    'serve': lambda _: Server().values(),
    'train': lambda _: Recorder((), 1).status(),
    'monitor': of_monitor,
    'adapt': of_adapt,
}


@pytest.mark.parametrize('node', STATUSES)
def test_keys_of_statuses(node: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    _, _, section = INTERFACES.partition(f'### `ros2 run lip_id_ros {node}`\n')
    words = set(re.findall(r'\w+', section.partition('\n### ')[0]))
    missing = set(STATUSES[node](tmp_path_factory)) - words
    assert not missing, f'describe {missing} of ~/status in docs/reference/interfaces.md'


TABLE = tomllib.loads((ROOT / 'scripts' / 'mutants.toml').read_text(encoding='utf-8'))['mutant']


@pytest.mark.parametrize('mutant', TABLE, ids=lambda mutant: mutant['name'])
def test_can_be_tried(mutant: dict[str, str | list[str]]) -> None:
    text = (ROOT / str(mutant['file'])).read_text(encoding='utf-8')
    assert text.count(str(mutant['old'])) == 1
    assert all((ROOT / test.partition('::')[0]).exists() for test in mutant['tests'])
