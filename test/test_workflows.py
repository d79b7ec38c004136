"""The workflows of the public CI call what is there, and actions that nobody can exchange."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
WORKFLOWS = sorted((ROOT / '.github' / 'workflows').glob('*.yml'))
TARGETS = re.findall(r'^([a-z-]+):', (ROOT / 'Makefile').read_text('utf-8'), re.MULTILINE)

# an unpacked source archive has no hidden folders
pytestmark = pytest.mark.skipif(not WORKFLOWS, reason='needs a checkout, with .github')


def jobs() -> Iterator[dict[str, Any]]:
    for path in WORKFLOWS:
        yield from yaml.safe_load(path.read_text('utf-8'))['jobs'].values()


def commands(job: dict[str, Any]) -> str:
    text = '\n'.join(step.get('run', '') for step in job['steps'])
    for key, values in job.get('strategy', {}).get('matrix', {}).items():
        named = '${{ matrix.%s }}' % key  # noqa: UP031
        text = '\n'.join(text.replace(named, value) for value in values)
    return text


def test_targets_of_make_exist() -> None:
    called = {name for job in jobs() for name in re.findall(r'\bmake (\S+)', commands(job))}
    assert {'check', 'test-fast', 'docs'} <= called
    assert called <= set(TARGETS)


def test_named_files_exist() -> None:
    text = '\n'.join(commands(job) for job in jobs())
    named = re.findall(r'src/lip_id_ros/(\S+)|\b(test/\S+)', text)
    assert named
    assert all((ROOT / ''.join(path)).exists() for path in named)


def test_actions_are_pinned_by_commit() -> None:
    used = [step['uses'] for job in jobs() for step in job['steps'] if 'uses' in step]
    assert used
    assert all(re.fullmatch(r'[\w-]+/[\w-]+@[0-9a-f]{40}', action) for action in used)
