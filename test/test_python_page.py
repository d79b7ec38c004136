"""The Python face: its page runs as it stands, and its import is light."""

from __future__ import annotations

from pathlib import Path
import re
import subprocess
import sys

from gp.arms import TwoLinks
import numpy as np
import pytest

import lip_id_ros as lip

ROOT = Path(__file__).resolve().parents[1]
HEAVY = ('rclpy', 'torch', 'pinocchio', 'matplotlib', 'numba', 'scipy', 'numpy')


def snippets(page: Path) -> list[str]:
    return re.findall(r'```python\n(.*?)```', page.read_text(encoding='utf-8'), flags=re.DOTALL)


def write_log(path: Path) -> None:
    rng = np.random.default_rng(1)
    t = np.arange(2000) * 0.01
    w = 2.0 * np.pi * rng.uniform(0.1, 0.7, (6, 1, 2))
    phase = rng.uniform(0.0, 2.0 * np.pi, (6, 1, 2))
    angle = w * t[:, None] + phase
    q, dq = 0.3 * np.sin(angle).sum(axis=0), 0.3 * (w * np.cos(angle)).sum(axis=0)
    ddq = -0.3 * (w**2 * np.sin(angle)).sum(axis=0)
    tau = TwoLinks().torque(q, dq, ddq) + 0.01 * rng.standard_normal(q.shape)
    names = [f'{part}_{joint}' for part in ('q', 'dq', 'tau') for joint in ('shoulder', 'elbow')]
    table = np.column_stack([t, q, dq, tau])
    np.savetxt(path, table, delimiter=',', header=','.join(['t', *names]), comments='')


@pytest.mark.slow
def test_every_snippet_of_the_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path / 'arm.csv')
    session: dict[str, object] = {}
    for snippet in snippets(ROOT / 'docs' / 'reference' / 'python.md'):
        exec(compile(snippet, 'docs/reference/python.md', 'exec'), session)
    nmse = lip.evaluate(session['model'], session['held_out']).nmse_percent  # type: ignore[arg-type]
    assert max(nmse) < 1.0
    joints = 'shoulder, elbow'
    assert repr(session['model']).startswith(f'<articulated model of {joints}; ')
    assert repr(session['held_out']).startswith(f'<data set of {joints}; ')
    assert 'must have shape' in capsys.readouterr().out


def test_the_first_snippet_stands_in_the_readme() -> None:
    first, *_ = snippets(ROOT / 'docs' / 'reference' / 'python.md')
    assert first in snippets(ROOT / 'README.md')


def test_every_public_name_is_there() -> None:
    assert sorted(lip.__all__) == dir(lip)
    for name in lip.__all__:
        assert getattr(lip, name) is not None
    with pytest.raises(AttributeError, match="'lip_id_ros' has no attribute 'unknown'"):
        _ = lip.unknown


def test_the_import_is_light() -> None:
    """Nothing heavy is imported; so little is left that its time need not be measured."""
    program = 'import lip_id_ros, sys; print(len(sys.modules), *sys.modules)'
    ran = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, cwd=ROOT)
    assert ran.returncode == 0, ran.stderr
    count, *modules = ran.stdout.split()
    assert not set(HEAVY) & set(modules)
    bare = subprocess.run(
        [sys.executable, '-c', 'import sys; print(len(sys.modules))'],
        capture_output=True,
        text=True,
        check=True,
    )
    assert int(count) - int(bare.stdout) < 40


def test_the_version_is_one() -> None:
    for file in ('setup.py', 'package.xml'):
        assert lip.__version__ in (ROOT / file).read_text(encoding='utf-8')
