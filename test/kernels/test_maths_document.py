"""docs/explanation/maths.md has the sections that the code names."""

from __future__ import annotations

from pathlib import Path
import re

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / 'docs' / 'explanation' / 'maths.md'


def sources(folder: str) -> str:
    """Return all Python text of a folder."""
    return '\n'.join(
        path.read_text(encoding='utf-8') for path in sorted((ROOT / folder).rglob('*.py'))
    )


def test_named_sections_exist() -> None:
    sections = re.findall(r'^## (\d+)\.', PAGE.read_text(encoding='utf-8'), re.MULTILINE)
    assert sections == [str(number) for number in range(1, len(sections) + 1)]
    named = re.findall(r'maths\.md,\s+section (\d+)', sources('lip_id_ros'))
    assert named
    assert set(named) <= set(sections)
