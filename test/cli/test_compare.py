"""`lip_id compare` from arguments to files."""

from __future__ import annotations

from collections.abc import Sequence
import json
from pathlib import Path

from cli.conftest import Workshop
import pytest

from lip_id_ros.cli import main
from lip_id_ros.comparison import Case, Results

pytestmark = pytest.mark.slow

Capture = pytest.CaptureFixture[str]


def compare(workshop: Workshop, *arguments: object) -> int:
    given = ['compare', workshop.bag, '--config', workshop.settings, '-o', 'out', *arguments]
    return main([str(argument) for argument in given])


def figures() -> dict[str, dict[str, dict[str, float]]]:
    groups: dict[str, dict[str, dict[str, float]]] = json.loads(
        Path('out/comparison.json').read_text()
    )['groups']
    return groups


def test_models_are_judged_on_the_end_of_the_recording(
    workshop: Workshop, here: Path, capsys: Capture
) -> None:
    assert compare(workshop, '--models', 'recursive,lip') == 0
    output = capsys.readouterr().out
    assert 'one unseen motion' in output
    assert 'Written: out/index.html' in output
    ((group, found),) = figures().items()
    assert group.endswith('training samples')
    assert list(found) == ['recursive', 'lip']
    assert 'data:image/png' in Path('out/index.html').read_text()


def test_finished_models_are_kept_and_numbers_of_samples_make_groups(
    workshop: Workshop, here: Path
) -> None:
    arguments = ('--models', 'recursive', '--test', workshop.other_bag, '--samples', '40,20')
    assert compare(workshop, *arguments) == 0
    before = {path: path.stat().st_mtime_ns for path in Path('out/cells').iterdir()}
    assert len(before) == 2
    assert compare(workshop, *arguments) == 0
    assert before == {path: path.stat().st_mtime_ns for path in Path('out/cells').iterdir()}
    assert list(figures()) == ['20 training samples', '40 training samples']
    assert (
        json.loads(Path('out/comparison.json').read_text())['cells'][0]['scores'][0]['test']
        == 'other'
    )


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        (('--models', 'svm'), "'svm' is not a model; there are"),
        (('--models', 'rigid_body'), "'rigid_body' needs the kinematics"),
        (('--models', 'rigid_body', '--urdf', 'no.urdf'), 'no.urdf: No such file'),
    ],
)
def test_errors_come_before_the_work(
    workshop: Workshop, here: Path, capsys: Capture, arguments: tuple[str, ...], sentence: str
) -> None:
    pytest.importorskip('pinocchio')
    assert compare(workshop, *arguments) == 1
    assert sentence in capsys.readouterr().err


@pytest.mark.parametrize('text', ['0', '10,,20', 'many', '-3'])
def test_numbers_of_samples_are_positive(text: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit):
        main(['compare', 'run', '-o', 'out', f'--samples={text}'])
    assert 'expected a whole number above 0' in capsys.readouterr().err


@pytest.mark.parametrize('share', [0.8, 0.25])
def test_the_first_share_of_the_samples_is_for_training(
    workshop: Workshop, here: Path, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Case] = []

    def keep(cases: Sequence[Case], *_: object) -> Results:
        seen.extend(cases)
        return Results((), (), ())

    monkeypatch.setattr('lip_id_ros.comparison.compare', keep)
    monkeypatch.setattr('lip_id_ros.comparison.report.write_comparison', lambda *_: Path('page'))
    settings = here / 'all.yaml'
    settings.write_text('preprocessing: {min_velocity: 0.0, decimate: 1}')
    given = ['compare', str(workshop.bag), '--config', str(settings), '-o', 'out']
    assert main([*given, '--train-share', str(share)]) == 0

    (case,) = seen
    (test,) = case.tests.values()
    assert case.train.n_samples == round(share * (case.train.n_samples + test.n_samples))
    assert case.train.t.max() < test.t.min()
