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


def installed(package: str, name: str) -> Path | None:
    """Return a program of a ROS package, from where `ros2 run` takes it; None if it is absent."""
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    places = (Path(prefix) / 'lib' / package / name for prefix in prefixes)
    return next((place for place in places if place.is_file()), None)
