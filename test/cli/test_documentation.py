"""docs/reference/interfaces.md promises what the command line and its files keep."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import re

from evaluation.models import small_model
from evaluation.stubs import Knowing
import numpy as np
import pytest
from simulation.pendulums import swing

from lip_id_ros.cli import main
from lip_id_ros.evaluation import evaluate, run
from lip_id_ros.evaluation.prediction import predicted_values, write_prediction
from lip_id_ros.files import read_npz

REFERENCE = Path(__file__).resolve().parents[2] / 'docs' / 'reference'
PAGE = (REFERENCE / 'interfaces.md').read_text(encoding='utf-8')


def section(title: str) -> str:
    _, _, rest = PAGE.partition(f'# {title}\n')
    assert rest, f'no section {title}'
    return re.split(r'^#+ ', rest, maxsplit=1, flags=re.MULTILINE)[0]


def named(text: str) -> set[str]:
    return {
        name
        for row in re.findall(r'^\| (`.*?) \|', text, flags=re.MULTILINE)
        for name in re.findall(r'`(\w+)`', row)
    }


@pytest.mark.parametrize(
    'verb',
    [
        'demo',
        'excite',
        'fit',
        'evaluate',
        'dataset',
        'inspect',
        'predict',
        'adapt',
        'check-plan',
        'export',
        'payload',
    ],
)
def test_options_are_those_of_the_help(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([verb, '--help'])
    usage = capsys.readouterr().out.split('\n\n')[0]
    (documented,) = re.findall(rf'^\| `lip_id {verb} (.*?)` \|', PAGE, flags=re.MULTILINE)

    options = set(re.findall(r'--\w+', usage)) - {'--help'}
    assert set(re.findall(r'--\w+', documented)) == options


def test_keys_of_evaluate() -> None:
    figures = evaluate(Knowing(), swing(1)).to_json()
    assert named(section('Figures of `evaluate --json`')) == set(figures)


def test_arrays_of_a_data_set(tmp_path: Path) -> None:
    data = swing(1)
    replace(data, low_passed_sign=np.sign(data.dq)).save(tmp_path / 'data.npz')
    arrays, _ = read_npz(tmp_path / 'data.npz')
    assert named(section('Data set (`.npz`)')) == set(arrays) | {'dt', 'header_json'}


def test_arrays_of_a_prediction(tmp_path: Path) -> None:
    found = predicted_values(Knowing(), run(Knowing(), swing(1)))
    write_prediction(tmp_path / 'out.npz', swing(1), found)
    arrays, _ = read_npz(tmp_path / 'out.npz')
    text = section('Prediction (`.npz`)')
    assert set(arrays) <= set(re.findall(r'`(\w+)`', text))


def test_the_model_can_be_loaded_as_documented(tmp_path: Path) -> None:
    from lip_id_ros.model import InverseDynamicsModel

    small_model().save(tmp_path / 'arm.npz')
    assert InverseDynamicsModel.load(tmp_path / 'arm.npz').n_joints == 3
