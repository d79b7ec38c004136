"""`compare_models` from arguments to files."""

from __future__ import annotations

from collections.abc import Sequence
import json
from pathlib import Path

import pytest
from simulation.pendulums import swing

from benchmarks import compare_models
from benchmarks.comparison import Case, Results
from lip_id_ros.errors import ConfigError
from lip_id_ros.simulation import write_bag

pytestmark = pytest.mark.slow

Capture = pytest.CaptureFixture[str]
SETTINGS = """
preprocessing: {cutoff_hz: 8.0}
fit: {subset: 25, max_samples: 50, iterations: 8}
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two bags and their settings, in the current folder."""
    monkeypatch.chdir(tmp_path)
    for seed, bag in enumerate(('run', 'other')):
        write_bag(tmp_path / bag, swing(seed, rate=50.0), start=1.7e9)
    (tmp_path / 'arm.yaml').write_text(SETTINGS)
    return tmp_path


def compare(*arguments: str) -> int:
    return compare_models.main(['run', '--config', 'arm.yaml', '-o', 'out', *arguments])


def figures() -> dict[str, dict[str, dict[str, float]]]:
    groups: dict[str, dict[str, dict[str, float]]] = json.loads(
        Path('out/comparison.json').read_text()
    )['groups']
    return groups


def test_models_are_judged_on_the_end_of_the_recording(capsys: Capture) -> None:
    assert compare('--models', 'recursive,lip') == 0
    output = capsys.readouterr().out
    assert 'one unseen motion' in output
    assert 'Written: out/index.html' in output
    ((group, found),) = figures().items()
    assert group.endswith('training samples')
    assert list(found) == ['recursive', 'lip']
    assert 'data:image/png' in Path('out/index.html').read_text()


def test_finished_models_are_kept_and_numbers_of_samples_make_groups() -> None:
    arguments = ('--models', 'recursive', '--test', 'other', '--samples', '40,20')
    assert compare(*arguments) == 0
    before = {path: path.stat().st_mtime_ns for path in Path('out/cells').iterdir()}
    assert len(before) == 2
    Path('out/index.html').unlink()  # as where the comparison was interrupted
    assert compare(*arguments) == 0
    assert before == {path: path.stat().st_mtime_ns for path in Path('out/cells').iterdir()}
    assert list(figures()) == ['20 training samples', '40 training samples']
    (score,) = json.loads(Path('out/comparison.json').read_text())['cells'][0]['scores']
    assert score['test'] == 'other'


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        (('--models', 'svm'), "'svm' is not a model; there are"),
        (('--models', 'rigid_body'), "'rigid_body' needs the kinematics"),
    ],
)
def test_errors_come_before_the_work(arguments: tuple[str, ...], sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        compare(*arguments)


@pytest.mark.parametrize('text', ['0', '10,,20', 'many', '-3'])
def test_numbers_of_samples_are_positive(text: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit):
        compare(f'--samples={text}')
    assert 'expected a whole number above 0' in capsys.readouterr().err


@pytest.mark.parametrize('share', [0.8, 0.25])
def test_the_first_share_of_the_samples_is_for_training(
    here: Path, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Case] = []

    def keep(cases: Sequence[Case], *_: object) -> Results:
        seen.extend(cases)
        return Results((), (), ())

    monkeypatch.setattr(compare_models, 'compare', keep)
    monkeypatch.setattr(compare_models, 'write_comparison', lambda *_: Path('page'))
    (here / 'arm.yaml').write_text('preprocessing: {min_velocity: 0.0, decimate: 1}')
    assert compare('--train-share', str(share)) == 0

    (case,) = seen
    (test,) = case.tests.values()
    assert case.train.n_samples == round(share * (case.train.n_samples + test.n_samples))
    assert case.train.t.max() < test.t.min()
