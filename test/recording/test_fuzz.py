"""A short run of the fuzzer; the long one is ``python -m benchmarks fuzz_readers``."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith('linux'), reason='limits memory as Linux does')
def test_broken_bags_never_crash_hang_or_take_memory(tmp_path: Path) -> None:
    ran = subprocess.run(
        [
            *(sys.executable, '-m', 'benchmarks', 'fuzz_readers'),
            *('--cases', '800', '--minutes', '0.5', '--findings', str(tmp_path / 'findings')),
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "'read': " in ran.stdout
    assert "'SourceError': " in ran.stdout
