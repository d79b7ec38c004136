"""`compare_models`: what is compared on which samples, and what is printed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from simulation.pendulums import swing

from benchmarks import compare_models
from benchmarks._results import Row
from benchmarks.baselines import Baseline
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError, DataError
from lip_id_ros.model import TorquePrediction
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation import write_bag

Capture = pytest.CaptureFixture[str]
SETTINGS = """
preprocessing: {cutoff_hz: 8.0, min_velocity: 0.0, decimate: 1}
fit: {subset: 25, max_samples: 50, iterations: 8}
"""


class Scaled(Baseline):
    """Answers with a multiple of the true torques of pendulums; is its own method."""

    size = 1

    def __init__(self, factor: float) -> None:
        data = swing(0)
        super().__init__(data.joint_names, data.joint_types)
        self.factor, self.fits = factor, list[Dataset]()

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Baseline:
        self.fits.append(dataset)
        return self

    def predict(self, q: Array, dq: Array, ddq: Array) -> TorquePrediction:
        return TorquePrediction(self.factor * q, None, None)


class Refusing:
    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Baseline:
        raise DataError('more is needed.')


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two bags and their settings, in the current folder."""
    monkeypatch.chdir(tmp_path)
    for seed, bag in enumerate(('run', 'other')):
        write_bag(tmp_path / bag, swing(seed, rate=50.0), start=1.7e9)
    (tmp_path / 'arm.yaml').write_text(SETTINGS)
    return tmp_path


def compare(*arguments: str) -> int:
    return compare_models.main(['run', '--config', 'arm.yaml', *arguments])


@pytest.mark.slow
def test_finished_fits_are_kept_and_numbers_of_samples_make_tables(
    here: Path, capsys: Capture
) -> None:
    arguments = ('--models', 'recursive,lip', '--test', 'other', '--samples', '40,20')
    assert compare(*arguments) == 0
    first = capsys.readouterr().out
    assert first.index('20 samples: nMSE [%], one') < first.index('40 samples: nMSE [%], one')
    rows = json.loads(Path('compare_models.json').read_text())
    assert len(rows) == 4
    assert all(list(row['motions']) == ['other'] for row in rows.values())
    assert compare(*arguments) == 0
    assert capsys.readouterr().out == first
    assert compare(*arguments[:-1], '20', '--seed', '1') == 0  # other settings, other fits
    assert len(json.loads(Path('compare_models.json').read_text())) == 6


@pytest.mark.parametrize('share', [0.8, 0.25])
def test_the_first_share_of_the_samples_is_for_training(
    here: Path, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = Scaled(1.0)
    monkeypatch.setattr(compare_models, 'method', lambda *_: known)
    assert compare('--models', 'se', '--train-share', str(share)) == 0
    (train,) = known.fits
    (row,) = json.loads(Path('compare_models.json').read_text()).values()
    ((name, motion),) = row['motions'].items()
    assert name == f'the last {100 * (1 - share):g} %'
    assert train.n_samples == round(share * (train.n_samples + motion['n_samples']))


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        (('--models', 'svm'), "'svm' is not a model; there are"),
        (('--models', 'rigid_body'), "'rigid_body' needs the kinematics"),
    ],
)
def test_errors_come_before_the_work(
    here: Path, arguments: tuple[str, ...], sentence: str
) -> None:
    with pytest.raises(ConfigError, match=sentence):
        compare(*arguments)


def test_what_cannot_be_fitted_is_a_row_that_says_why() -> None:
    row = compare_models.measured(Refusing(), swing(0), {}, FitSettings(), silent)
    assert row == {'error': 'more is needed.'}
    assert list(compare_models.tables('20 samples', {'never': row})) == []


def test_figures_are_medians_over_motions() -> None:
    """Of three motions, whose medians are no means; of the first joint one has no torque."""
    motions = {
        name: {
            'joint_names': ['a', 'b'],
            'nmse_percent': [first, second],
            'nmse_percent_mean': mean,
            'kinetic_nmse_percent': None,
            'potential_nmse_percent': first,
            'rmse_in_motion': [first, second],
            'rmse_near_rest': [second, None],
        }
        for name, first, second, mean in (
            ('x', 1.0, 3.0, 2.0),
            ('y', 10.0, 2.0, 6.0),
            ('z', 2.0, 30.0, 16.0),
        )
    }
    row: Row = {'fit_seconds': 1.0, 'query_us': 20.0, 'size': 7, 'motions': motions}
    errors, rest, costs = compare_models.tables('7 samples', {'se': row})
    assert errors.title == '7 samples: nMSE [%], medians of 3 unseen motions'
    assert errors.rows == [('se', '2', '3', '6', '-', '2')]
    assert rest.rows == [('se', '2, 3', '3, nan')]
    assert costs.rows == [('se', '1', '20', '7')]
