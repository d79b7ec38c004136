"""docs/reference/health.md lists what the code finds."""

from __future__ import annotations

from pathlib import Path
import re

from health.recordings import sound

from lip_id_ros.health import CHECKS, evidence_of, health

REFERENCE = Path(__file__).resolve().parents[2] / 'docs' / 'reference'
PAGE = (REFERENCE / 'health.md').read_text(encoding='utf-8')


def test_the_table_is_that_of_the_code() -> None:
    documented = re.findall(
        r'^\| `(\w+)` \| (\w+) \| (.+?) \| (.+?) \|$', PAGE, flags=re.MULTILINE
    )
    assert documented == [
        (check.code, check.severity.value, check.meaning, check.remedy) for check in CHECKS
    ]


def test_the_figures_are_those_of_the_code() -> None:
    described = health(evidence_of(sound()))
    text = PAGE.partition('In JSON,')[2].partition('## How')[0]
    named = set(re.findall(r'`(\w+)`', text))
    assert set(described) | set(described['joints']['arm_joint1']) <= named


def test_codes_are_unique() -> None:
    codes = [check.code for check in CHECKS]
    assert len(set(codes)) == len(codes)
