"""Hostile joint names go through every verb, and are shown whole."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cli.conftest import Workshop
import pytest
from simulation.pendulums import swing

from lip_id_ros.cli import main
from lip_id_ros.escaping import for_page, printable
from lip_id_ros.simulation import write_bag

Capture = pytest.CaptureFixture[str]
NAMES = ('arm[/red]left', 'a$\\frac{$', '\x1b[31m<b>wrist')


@pytest.fixture
def bag(here: Path) -> str:
    write_bag(here / 'bag', replace(swing(1, rate=50.0), joint_names=NAMES))
    return 'bag'


@pytest.mark.slow
def test_names_are_data_everywhere(
    workshop: Workshop, bag: str, here: Path, capsys: Capture
) -> None:
    for arguments in (
        ('inspect', bag, '--report', 'health'),
        ('fit', bag, '-o', 'm.npz', '--config', str(workshop.settings)),
        ('inspect', 'm.npz'),
        ('evaluate', 'm.npz', bag, '--report', 'report'),
    ):
        capsys.readouterr()
        assert main(arguments) == 0, arguments
        text = capsys.readouterr().out
        assert all(printable(name) in text for name in NAMES), arguments
        assert '\x1b' not in text
    for page in (here / 'health', here / 'report'):
        html = (page / 'index.html').read_text(encoding='utf-8')
        assert all(for_page(name) in html.replace('<wbr>', '') for name in NAMES)
        assert '<b>wrist' not in html


def test_an_error_shows_names_without_their_effects(bag: str, capsys: Capture) -> None:
    assert main(['dataset', bag, '-o', 'a.npz', '--joints', 'none\x1b[2J']) == 1
    error = capsys.readouterr().err
    assert '\x1b' not in error
    assert r'\x1b[2J' in error
