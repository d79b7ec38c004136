"""docs/maths.md: the tests that it names exist, and so do the sections that the code names."""

from __future__ import annotations

from pathlib import Path
import re

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = [ROOT / 'docs' / 'maths.md', ROOT / 'docs' / 'adr' / '0004-kernels-as-programs.md']


def sources(folder: str) -> str:
    """Return all Python text of a folder."""
    return '\n'.join(
        path.read_text(encoding='utf-8') for path in sorted((ROOT / folder).rglob('*.py'))
    )


def test_named_tests_exist() -> None:
    named = {
        name
        for document in DOCUMENTS
        for name in re.findall(r'`(test_\w+)`', document.read_text(encoding='utf-8'))
    }
    assert len(named) > 30
    assert named <= set(re.findall(r'^def (test_\w+)\(', sources('test'), re.MULTILINE))


def test_named_sections_exist() -> None:
    sections = re.findall(r'^## (\d+)\.', DOCUMENTS[0].read_text(encoding='utf-8'), re.MULTILINE)
    assert sections == [str(number) for number in range(1, len(sections) + 1)]
    named = re.findall(r'maths\.md,\s+section (\d+)', sources('lip_id_ros'))
    assert named
    assert set(named) <= set(sections)
