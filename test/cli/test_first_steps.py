"""What a newcomer types first: no verb at all, `demo`, and the tabulator."""

from __future__ import annotations

from pathlib import Path
import sys
import webbrowser

from cli.conftest import Capture, lip_id
import numpy as np
from programs import run
import pytest

import lip_id_ros as lip
from lip_id_ros.cli import main
from lip_id_ros.export.friction_table import friction_table
from lip_id_ros.simulation.four_joints import COULOMB, VISCOUS


def test_without_arguments_it_says_how_to_begin(capsys: Capture) -> None:
    assert main([]) == 0
    text = capsys.readouterr().out
    assert 'lip_id demo' in text
    assert 'lip_id fit my_bag' in text
    assert len(text.splitlines()) <= 12


@pytest.mark.slow
def test_the_demo_learns_an_arm_and_opens_its_report(
    here: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, 'open', opened.append)
    lip_id('demo', '--seconds', 25)

    shown = capsys.readouterr().out
    folder = here / 'lip_id_demo'
    assert opened == [(folder / 'index.html').as_uri()]
    for command in (
        'inspect lip_id_demo/training_bag',
        'fit lip_id_demo/training_bag -o lip_id_demo/arm.npz',
        'evaluate lip_id_demo/arm.npz lip_id_demo/another_bag',
    ):
        assert f'$ lip_id {command}' in shown
    assert 'lip_id inspect my_bag' in shown
    model = lip.InverseDynamicsModel.load(folder / 'arm.npz')
    friction = {(each.joint, each.term): each.value for each in friction_table(model)}
    for term, truth in (('viscous', VISCOUS), ('Coulomb', COULOMB)):
        found = [friction[joint, term] for joint in model.joint_names]
        np.testing.assert_allclose(found, truth, rtol=0.1)
    unseen = lip.load_dataset(str(folder / 'another_bag'))
    assert max(lip.evaluate(model, unseen).nmse_percent) < 5.0


@pytest.mark.parametrize(
    ('line', 'expected'),
    [('lip_id ins', {'inspect '}), ('lip_id demo --no', {'--no-browser '})],
)
def test_the_shell_completes_the_verbs(tmp_path: Path, line: str, expected: set[str]) -> None:
    answer = tmp_path / 'answer'
    ran = run(
        *(sys.executable, '-m', 'lip_id_ros'),
        _ARGCOMPLETE='1',
        _ARGCOMPLETE_STDOUT_FILENAME=str(answer),
        COMP_LINE=line,
        COMP_POINT=str(len(line)),
    )
    assert ran.returncode == 0, ran.stderr
    assert set(answer.read_text().split('\v')) == expected
