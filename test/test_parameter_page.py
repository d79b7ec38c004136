"""docs/reference/parameters.md says what the tables say."""

from __future__ import annotations

from pathlib import Path

import pytest

from lip_id_ros import parameter_page
from lip_id_ros.parameter_page import node_parameters

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'reference' / 'parameters.md'


def test_the_page_is_current(capsys: pytest.CaptureFixture[str]) -> None:
    parameter_page.main()
    written = capsys.readouterr().out
    assert PAGE.read_text(encoding='utf-8') == written, f'run {parameter_page.COMMAND}'


def test_every_parameter_has_one_line() -> None:
    lines = parameter_page.page().splitlines()
    names = [line.split('`')[1] for line in lines if line.startswith('| `')]
    assert names == [name for table in node_parameters().values() for name in table]
    assert (
        '| `recording.effort_offset` | double array | `[]` | >= -1e+09 and <= 1e+09 | N m or N | '
        'at the next fit or data set | Added to the scaled effort, per joint; empty for 0. |'
    ) in lines
