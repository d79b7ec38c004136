"""Models of the literature, and kernels, on the command line."""

from __future__ import annotations

import json
from pathlib import Path

from cli.conftest import Capture, lip_id, Workshop
import numpy as np
import pytest

from lip_id_ros.baselines import MODELS
from lip_id_ros.cli import arguments, main
from lip_id_ros.files import read_npz
from lip_id_ros.model import InverseDynamicsModel


@pytest.mark.slow
def test_models_of_the_literature_are_fitted_evaluated_and_predict(
    workshop: Workshop, here: Path, capsys: Capture
) -> None:
    pytest.importorskip('torch')
    lip_id(
        'fit', workshop.bag, '-o', 'se.npz', '--config', workshop.settings, '--model', 'se',
        '--holdout', 0.3,
    )  # fmt: skip
    output = capsys.readouterr().out
    assert 'se: 3 joints' in output
    assert 'Held out: the last 30 %' in output
    lip_id('inspect', 'se.npz')
    assert 'model: se' in capsys.readouterr().out

    lip_id('evaluate', 'se.npz', workshop.other_bag, '--json', 'figures.json')
    assert 'inertia' not in capsys.readouterr().out
    figures = json.loads((here / 'figures.json').read_text())
    assert figures['inertia_not_pd_percent'] is None
    lip_id('predict', 'se.npz', workshop.other_bag, '-o', 'out.npz')
    arrays, _ = read_npz('out.npz')
    assert {'tau', 'tau_measured'} <= set(arrays)
    assert not {'kinetic', 'tau_std', 'gravity'} & set(arrays)
    error = np.mean((arrays['tau'] - arrays['tau_measured']) ** 2, axis=0)
    np.testing.assert_allclose(error, np.square(figures['rmse']))
    lip_id('predict', 'se.npz', workshop.other_bag, '-o', 'out.mcap')

    lip_id('evaluate', 'se.npz', workshop.other_bag, '--report', 'out')
    assert {path.name for path in (here / 'out').glob('*.png')} == {
        'torque.png', 'errors.png', 'residual.png'
    }  # fmt: skip
    capsys.readouterr()
    assert main(['bench', 'se.npz']) == 1
    assert 'bench and serve need one of this package' in capsys.readouterr().err


def test_a_kernel_is_a_model_too(workshop: Workshop, here: Path) -> None:
    lip_id('fit', workshop.bag, '-o', 'a.npz', '--config', workshop.settings, '--model', 'lip')
    assert InverseDynamicsModel.load('a.npz').kernel == 'lip'


def test_models_of_the_command_line_are_those_there_are() -> None:
    assert sorted(arguments.MODELS) == sorted(MODELS)


def test_a_model_that_needs_kinematics_says_so(
    workshop: Workshop, here: Path, capsys: Capture
) -> None:
    fit = ['fit', str(workshop.bag), '-o', 'a.npz', '--model', 'rigid_body']
    assert main(fit) == 1
    assert "'rigid_body' needs the kinematics of the robot" in capsys.readouterr().err
    assert not list(here.iterdir())
