"""Run one benchmark, or two quick ones: python -m benchmarks [NAME] [its arguments]."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path
import sys
import tempfile

QUICK = (
    ('query', '--calls', '20000'),
    (
        *('panda_monte_carlo', '--joints', '4', '--seeds', '0'),
        *('--models', 'articulated', 'rigid_body'),
    ),
)
"""How fast and how accurate; figures are kept nowhere."""


def available() -> list[str]:
    """Return the names of all benchmarks."""
    files = Path(__file__).parent.glob('[!_]*.py')
    return sorted(file.stem for file in files)


def explained(name: str) -> str:
    """Return the name of a benchmark and the first sentence about it."""
    text = Path(__file__).with_name(f'{name}.py').read_text(encoding='utf-8')
    return f'  {name:18}{(ast.get_docstring(ast.parse(text)) or "").splitlines()[0]}'


def main(arguments: list[str]) -> int:
    """Run the named benchmark with the remaining arguments."""
    if not arguments:
        query, accuracy = QUICK
        with tempfile.TemporaryDirectory() as folder:
            return max(main([*query]), main([*accuracy, '--results', f'{folder}/figures.json']))
    name, *rest = arguments
    if name in ('-h', '--help'):
        print(__doc__, *map(explained, available()), sep='\n')
        return 0
    if name not in available():
        print(f'no benchmark {name!r}; there are {", ".join(available())}', file=sys.stderr)
        return 2
    status: int = importlib.import_module(f'benchmarks.{name}').main(rest)
    return status


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
