"""What is measured, what is kept, and what is written."""

from __future__ import annotations

from dataclasses import replace
import json
import math
from pathlib import Path
import re

import numpy as np
import pytest
from simulation.pendulums import swing
from test_imports import BASE, PARTS

from benchmarks.baselines import Method
from benchmarks.comparison import Case, Cell, compare, report, Results, Store, thinned
from benchmarks.comparison.cell import code_version, PACKAGE, source_digest
from benchmarks.comparison.cell import PARTS as CODE
from benchmarks.comparison.report import write_comparison
from benchmarks.comparison.run import groups, meanings, remarks, tables
from benchmarks.tests.methods import Refusing, Scaled
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError
from lip_id_ros.settings import FitSettings

SETTINGS = FitSettings()


def data(seed: int) -> Dataset:
    """Torques that are twice the positions, so that every error is known."""
    some = swing(seed)
    return replace(some, tau=2 * some.q, tau_noiseless=None, potential=None)


def case(name: str = 'first', train: Dataset | None = None) -> Case:
    tests = {'a': data(1), 'b': data(2)}
    return Case(name, 'pendulums', train if train is not None else data(0), tests)


def run(
    folder: Path, methods: dict[str, Method], cases: list[Case], settings: FitSettings = SETTINGS
) -> Results:
    return compare(
        cases, list(methods), settings, Store(folder), make=lambda name, _: methods[name]
    )


def test_errors_are_those_on_the_unseen_motions(tmp_path: Path) -> None:
    (cell,) = run(tmp_path, {'half': Scaled(1.0)}, [case()]).cells
    assert [score.test for score in cell.scores] == ['a', 'b']
    for score, test in zip(cell.scores, (data(1), data(2)), strict=True):
        expected = 100 * np.mean(test.q**2, axis=0) / np.var(2 * test.q, axis=0)
        np.testing.assert_allclose(score.nmse_percent, expected)
        np.testing.assert_allclose(score.rmse, np.sqrt(np.mean(test.q**2, axis=0)))
        assert score.mean == pytest.approx(expected.mean())
        assert score.kinetic_nmse_percent > 0
        assert math.isnan(score.potential_nmse_percent)
    assert cell.n_train == data(0).n_samples
    assert cell.fit_seconds >= 0
    assert cell.query_us > 0


def test_what_is_finished_is_not_done_again(tmp_path: Path) -> None:
    method = Scaled(1.0)
    first = run(tmp_path, {'half': method}, [case()])
    second = run(tmp_path, {'half': method}, [case(), case('second')])
    assert method.fits == 2
    assert second.cells[0] == first.cells[0]
    run(tmp_path, {'other': method}, [case()])
    run(tmp_path, {'half': method}, [case()], FitSettings(subset=7))
    run(tmp_path, {'half': method}, [case(train=thinned(data(0), 30))])
    assert method.fits == 5


def test_a_damaged_cell_is_made_again(tmp_path: Path) -> None:
    method = Scaled(1.0)
    (path,) = run(tmp_path, {'half': method}, [case()]).paths
    path.write_bytes(path.read_bytes()[:100])
    assert len(run(tmp_path, {'half': method}, [case()]).cells) == 1
    assert method.fits == 2


def test_what_cannot_be_fitted_is_said_and_the_rest_goes_on(tmp_path: Path) -> None:
    results = run(tmp_path, {'never': Refusing(), 'half': Scaled(1.0)}, [case()])
    assert [cell.model for cell in results.cells] == ['half']
    assert results.failures == ('never on first: more is needed.',)


def test_where_nothing_can_be_fitted_the_page_says_why(tmp_path: Path) -> None:
    results = run(tmp_path / 'cells', {'never': Refusing()}, [case()])
    store = Store(tmp_path / 'cells')
    page = write_comparison(tmp_path, 'Title', [case()], results, store, [])
    assert 'never on first: more is needed.' in page.read_text(encoding='utf-8')


def test_a_model_that_is_missing_is_said_before_the_work(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='name its URDF file'):
        compare([case()], ['recursive', 'rigid_body'], SETTINGS, Store(tmp_path))
    assert not list(tmp_path.iterdir())


def test_cells_survive_json(tmp_path: Path) -> None:
    (cell,) = run(tmp_path, {'half': Scaled(1.0)}, [case()]).cells
    text = json.dumps(cell.to_json(), allow_nan=False)
    assert json.loads(text)['scores'][0]['potential_nmse_percent'] is None
    assert repr(Cell.from_json(json.loads(text))) == repr(cell)


def test_thinning_keeps_the_ends() -> None:
    whole = data(0)
    some = thinned(whole, 10)
    assert some.n_samples == 10
    np.testing.assert_array_equal(some.t[[0, -1]], whole.t[[0, -1]])
    assert thinned(whole, 10**6) is whole


@pytest.mark.slow
def test_the_page_holds_everything_and_needs_no_network(tmp_path: Path) -> None:
    methods: dict[str, Method] = {'half': Scaled(1.0), 'good': Scaled(1.9), 'never': Refusing()}
    cases = [
        Case(f'{n} samples', f'{n} samples', thinned(data(0), n), {'a': data(1), 'b': data(2)})
        for n in (20, 40)
    ]
    results = run(tmp_path / 'cells', methods, cases)
    store = Store(tmp_path / 'cells')
    facts = [('recordings', '<run>')]
    page = write_comparison(tmp_path, 'Title', cases, results, store, facts)

    html = page.read_text(encoding='utf-8')
    assert not re.search(r'(src|href)="(?!data:)', html)
    assert 'http' not in html
    # a box plot for each group, the curve over the samples, the energies
    assert html.count('data:image/png;base64,') == 4
    assert 'never on 20 samples: more is needed.' in html
    assert '&lt;run&gt;' in html

    numbers = json.loads((tmp_path / 'comparison.json').read_text())
    medians = numbers['groups']['40 samples']
    assert set(medians) == {'half', 'good'}
    assert medians['good']['nmse_percent_mean'] == pytest.approx(
        medians['half']['nmse_percent_mean'] / 100
    )
    assert medians['half']['motions'] == 2
    assert len(numbers['cells']) == 4
    assert len(numbers['failures']) == 2


def test_results_of_other_code_are_kept_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    method, store = Scaled(1.0), Store(tmp_path / 'cells')
    first = run(tmp_path / 'cells', {'half': method}, [case()])
    assert remarks(first) == []
    (cell,) = first.cells
    assert cell.code == code_version()

    monkeypatch.setattr('benchmarks.comparison.run.code_version', lambda: '9-new')
    again = run(tmp_path / 'cells', {'half': method}, [case()])
    assert method.fits == 1
    (sentence,) = remarks(again)
    assert f'1 of 1 results were kept from other code ({cell.code}; this is 9-new)' in sentence
    page = write_comparison(tmp_path, 'Title', [case()], again, store, [])
    assert sentence in page.read_text(encoding='utf-8')


def test_models_no_better_than_the_mean_are_named(tmp_path: Path) -> None:
    methods: dict[str, Method] = {'zero': Scaled(0.0), 'good': Scaled(1.9)}
    results = run(tmp_path, methods, [case()])
    joints = ', '.join(results.cells[0].joint_names)
    sentence = f'pendulums: hardly better than the mean of the torque: zero at {joints}.'
    assert remarks(results) == [sentence]


def test_a_cell_from_before_codes_were_noted_is_of_unknown_code(tmp_path: Path) -> None:
    (cell,) = run(tmp_path, {'half': Scaled(1.0)}, [case()]).cells
    content = cell.to_json()
    del content['code']
    assert Cell.from_json(content).code == 'unknown'


def test_the_code_is_all_that_methods_are_made_of() -> None:
    rooms = {path.stem for path in CODE if path.parent == PACKAGE}
    assert rooms >= {room for each in rooms & {*PARTS} for room in PARTS[each]}
    # but for what no figure depends on: texts, files, processes
    others = {'checked_file', 'csv_table', 'errors', 'escaping', 'files', 'packable'}
    others |= {'processes', 'progress'}
    assert rooms >= BASE - others
    assert all(path.exists() for path in CODE)


def test_the_digest_is_that_of_the_sources(tmp_path: Path) -> None:
    (tmp_path / 'part').mkdir()
    (tmp_path / 'part' / 'a.py').write_text('a = 1')
    before = source_digest([tmp_path / 'part'])
    (tmp_path / 'part' / 'notes.txt').write_text('no source')
    assert source_digest([tmp_path / 'part']) == before
    (tmp_path / 'part' / 'a.py').write_text('a = 2')
    changed = source_digest([tmp_path / 'part'])
    (tmp_path / 'part' / 'a.py').rename(tmp_path / 'part' / 'b.py')
    assert len({before, changed, source_digest([tmp_path / 'part'])}) == 3


def test_one_unseen_motion_is_drawn_as_points_and_several_as_boxes(tmp_path: Path) -> None:
    methods: dict[str, Method] = {'half': Scaled(1.0), 'good': Scaled(1.9)}
    one = Case('one', 'pendulums', data(0), {'a': data(1)})
    drawn = []
    for each in (one, case()):
        cells = run(tmp_path, methods, [each]).cells
        panel = report.boxes(groups(cells)['pendulums']).axes[0]
        drawn.append((len(panel.patches), len(panel.get_lines())))
        assert [tick.get_text() for tick in panel.get_xticklabels()] == ['half', 'good']
    (no_boxes, points), (boxes, lines) = drawn
    assert (no_boxes, points, boxes) == (0, 2, 2)
    assert lines > 2


def test_models_are_explained_and_unknown_energies_have_no_columns(tmp_path: Path) -> None:
    (with_truth,) = run(tmp_path, {'recursive': Scaled(1.0)}, [case()]).cells
    without = replace(
        with_truth,
        scores=tuple(replace(s, kinetic_nmse_percent=math.nan) for s in with_truth.scores),
    )
    for cell, header in ((with_truth, ('mean', 'kinetic')), (without, ('mean',))):
        errors, *_ = tables(Results((cell,), (), ()))
        assert tuple(errors.header) == ('model', *cell.joint_names, *header)
    assert 'composed from base to tip' in meanings([with_truth])['recursive']


def test_a_cell_is_that_of_all_values_of_its_data(tmp_path: Path) -> None:
    plain, settings = case(), FitSettings()
    motion = plain.train
    changed = [
        replace(motion, joint_types=('prismatic', *motion.joint_types[1:])),
        replace(motion, t=2.0 * motion.t),
        replace(motion, gravity_compensated=True),
    ]
    cases = [plain, *(replace(plain, train=each) for each in changed)]
    paths = {Store(tmp_path).path(each, 'se', settings) for each in cases}
    assert len(paths) == len(cases)
