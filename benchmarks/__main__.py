"""Run one benchmark, or the quick ones: ``python -m benchmarks [NAME] [its arguments]``."""

from __future__ import annotations

import importlib
from pathlib import Path
import sys

QUICK = ('panda_fit',)


def available() -> list[str]:
    """Return the names of all benchmarks."""
    files = Path(__file__).parent.glob('[!_]*.py')
    return sorted(file.stem for file in files)


def main(arguments: list[str]) -> int:
    """Run the named benchmark with the remaining arguments."""
    if not arguments:
        return max(run(name, []) for name in QUICK)
    name, *rest = arguments
    if name not in available():
        print(f'no benchmark {name!r}; there are {", ".join(available())}', file=sys.stderr)
        return 2
    return run(name, rest)


def run(name: str, arguments: list[str]) -> int:
    """Run one benchmark and return its exit status."""
    status: int = importlib.import_module(f'benchmarks.{name}').main(arguments)
    return status


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
