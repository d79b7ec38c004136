"""The programs of the package, before they run."""

from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys

import pytest

from lip_id_ros import __main__ as programs

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize(('name', 'imported'), [('lip_id', 'argparse'), ('serve', 'yaml')])
def test_an_interrupt_while_a_program_is_imported_leaves_no_traceback(
    name: str, imported: str, tmp_path: Path
) -> None:
    if name == 'serve':
        pytest.importorskip('rclpy', reason='needs ROS 2')
    (tmp_path / f'{imported}.py').write_text(
        "import time\nprint('imports', flush=True)\ntime.sleep(3600)\n"
    )
    path = [str(tmp_path), str(ROOT), os.environ.get('PYTHONPATH', '')]
    process = subprocess.Popen(
        [sys.executable, '-c', f'from lip_id_ros.__main__ import {name}; {name}()'],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b'imports\n'
    process.send_signal(signal.SIGINT)
    _, error = process.communicate()
    assert process.returncode == -signal.SIGINT
    assert error == b''


def test_what_an_interrupt_does_is_left_to_the_program(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, 'argv', ['lip_id', '--version'])
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(SystemExit):
        programs.lip_id()
    assert capsys.readouterr().out
    assert signal.getsignal(signal.SIGINT) is before
