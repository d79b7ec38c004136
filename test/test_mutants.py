"""The table of deliberate bugs fits the sources: each text occurs once, each test exists."""

from __future__ import annotations

from pathlib import Path
import tomllib

import pytest

ROOT = Path(__file__).resolve().parents[1]
TABLE = tomllib.loads((ROOT / 'scripts' / 'mutants.toml').read_text(encoding='utf-8'))['mutant']


@pytest.mark.parametrize('mutant', TABLE, ids=lambda mutant: mutant['name'])
def test_can_be_tried(mutant: dict[str, str | list[str]]) -> None:
    text = (ROOT / str(mutant['file'])).read_text(encoding='utf-8')
    assert text.count(str(mutant['old'])) == 1
    assert all((ROOT / test.partition('::')[0]).exists() for test in mutant['tests'])
