"""Programs that tests run."""

from __future__ import annotations

import os
from pathlib import Path
import subprocess


def run(*command: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a program to its end, with changes to this environment."""
    return subprocess.run(
        [str(word) for word in command],
        capture_output=True,
        text=True,
        env=os.environ | environment,
        check=False,
    )
