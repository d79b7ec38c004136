"""The report is complete, correct where it can be checked, and needs no network."""

from __future__ import annotations

import base64
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

from evaluation.stubs import Knowing
from matplotlib.figure import Figure
import numpy as np
import pytest
from simulation.pendulums import swing

from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.evaluation import Outcome, run, score
from lip_id_ros.evaluation.report import Band, band, figures, Labels, write_report
from lip_id_ros.evaluation.report.style import broken_at, MOST_POINTS, shown_rows, times

pytestmark = pytest.mark.slow

PICTURES = ('torque', 'errors', 'residual', 'energies', 'torque_split', 'friction')
PNG = b'\x89PNG\r\n\x1a\n'


def assessed(data: Dataset, estimator: Knowing) -> tuple[Outcome, Band]:
    outcome = run(estimator, data)
    uncertainty = band(estimator, outcome)
    assert uncertainty is not None
    return outcome, uncertainty


class Links(HTMLParser):
    """Everything that a page would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.targets += [value or '' for name, value in attrs if name in ('src', 'href')]


def texts(figure: Figure) -> set[str]:
    panels = [panel for panel in figure.axes if panel.get_visible()]
    return {panel.get_title('left') for panel in panels} | {panel.get_ylabel() for panel in panels}


def test_recordings_are_drawn_one_after_another() -> None:
    """Logs begin at zero, and bags days apart."""
    first, second, third = swing(0), swing(1), swing(2)
    joined = concatenate([first, second, replace(third, t=third.t + 1e6)])
    t = times(joined)
    assert t[0] == 0.0
    steps = np.diff(joined.t) * (np.diff(joined.recording) == 0)
    np.testing.assert_allclose(np.diff(t), steps, atol=1e-9)


def test_report_is_pictures_and_one_page_that_holds_them(tmp_path: Path) -> None:
    outcome, uncertainty = assessed(swing(1), Knowing(torque_error=0.1))
    labels = Labels('Title <1>', ['Beware & read.'], [('source', 'bag')])

    page = write_report(tmp_path / 'new' / 'out', outcome, score(outcome), uncertainty, labels)

    written = {path.name for path in page.parent.iterdir()}
    assert written == {f'{name}.png' for name in PICTURES} | {'index.html'}
    text = page.read_text(encoding='utf-8')
    links = Links()
    links.feed(text)
    images = [
        base64.b64decode(target.removeprefix('data:image/png;base64,')) for target in links.targets
    ]
    assert images == [(page.parent / f'{name}.png').read_bytes() for name in PICTURES]
    assert all(image.startswith(PNG) for image in images)
    assert 'Title &lt;1&gt;' in text
    assert 'Beware &amp; read.' in text
    assert 'shoulder' in text


def test_an_older_report_is_replaced(tmp_path: Path) -> None:
    outcome, uncertainty = assessed(swing(1), Knowing())
    for title in ('First', 'Second'):
        page = write_report(tmp_path, outcome, score(outcome), uncertainty, Labels(title))

    assert 'First' not in page.read_text(encoding='utf-8')
    assert len(list(tmp_path.iterdir())) == len(PICTURES) + 1


def test_every_axis_has_a_unit() -> None:
    data = replace(swing(1), joint_types=('revolute', 'prismatic', 'revolute'))
    outcome, uncertainty = assessed(data, Knowing())
    figure = figures.torque(outcome, score(outcome), uncertainty)

    assert texts(figure) == {'shoulder', 'elbow', 'wrist', 'torque [N m]', 'force [N]'}
    energies = figures.energies(outcome, score(outcome), uncertainty)
    assert texts(energies) == {'kinetic energy', 'potential energy', 'energy [J]'}


def test_curves_are_the_samples() -> None:
    data = swing(1)
    outcome, uncertainty = assessed(data, Knowing(torque_error=0.1))
    panel = figures.torque(outcome, score(outcome), uncertainty).axes[0]
    curves = {line.get_label(): line for line in panel.get_lines()}

    np.testing.assert_array_equal(curves['measured'].get_ydata(), data.tau[:, 0])
    np.testing.assert_array_equal(curves['predicted'].get_ydata(), outcome.prediction.tau[:, 0])
    np.testing.assert_array_equal(curves['measured'].get_xdata(), data.t)


def test_true_potential_energy_is_moved_onto_the_estimate() -> None:
    data = swing(1)
    outcome, uncertainty = assessed(data, Knowing(offset=30.0))
    panel = figures.energies(outcome, score(outcome), uncertainty).axes[1]
    curves = {line.get_label(): line for line in panel.get_lines()}

    np.testing.assert_allclose(
        np.asarray(curves['true'].get_ydata()), np.asarray(curves['predicted'].get_ydata())
    )


def test_without_truth_or_potential_energy_there_is_one_panel() -> None:
    data = replace(swing(1), kinetic=None, potential=None)
    outcome, uncertainty = assessed(data, Knowing(offset=None))
    figure = figures.energies(outcome, score(outcome), uncertainty)

    assert texts(figure) == {'kinetic energy', 'energy [J]'}
    assert 'true' not in {line.get_label() for line in figure.axes[0].get_lines()}


def test_bars_are_the_errors() -> None:
    outcome, _ = assessed(swing(1), Knowing(torque_error=0.1, energy_error=0.2))
    evaluation = score(outcome)
    panel = figures.errors(evaluation).axes[0]
    widths = [patch.get_width() for patch in panel.patches]  # type: ignore[attr-defined]

    assert widths[:3] == pytest.approx(list(evaluation.nmse_percent))
    assert widths[3] == pytest.approx(evaluation.kinetic_nmse_percent)
    assert [label.get_text() for label in panel.get_yticklabels()] == [
        *evaluation.joint_names,
        'kinetic energy',
        'potential energy',
    ]


def test_a_joint_predicted_no_better_than_its_mean_is_called_that_in_pictures() -> None:
    outcome, uncertainty = assessed(swing(1), Knowing())
    evaluation = score(outcome)
    useless = replace(evaluation, nmse_percent=(95.0, *evaluation.nmse_percent[1:]))
    first, second, *_ = figures.torque(outcome, useless, uncertainty).axes
    assert first.get_title('right') == 'no better than the mean: nMSE 95 %'
    assert second.get_title('right').startswith('nMSE')
    panel = figures.errors(useless).axes[0]
    (line,) = panel.get_lines()
    assert list(np.asarray(line.get_xdata())) == [100.0, 100.0]
    assert panel.get_xlim()[1] > 100.0


def test_band_is_that_of_a_measurement_and_known_everywhere() -> None:
    outcome, uncertainty = assessed(swing(1, duration=40.0), Knowing())

    np.testing.assert_allclose(uncertainty.tau, 0.5)  # 0.3 of the prediction, 0.4 of the noise
    assert len(uncertainty.rows) == 200
    assert (uncertainty.rows[0], uncertainty.rows[-1]) == (0, outcome.dataset.n_samples - 1)
    (shade,) = figures.residual(outcome, uncertainty).axes[0].collections
    outline = np.asarray(shade.get_paths()[0].vertices)
    np.testing.assert_allclose(abs(outline[:, 1]), 1.0)  # two deviations, at every time
    assert len(np.unique(outline[:, 0])) == min(MOST_POINTS, outcome.dataset.n_samples)


def test_no_line_crosses_a_gap() -> None:
    segment = np.array([0, 0, 3, 3, 3, 7])
    curve = broken_at(segment, np.arange(6.0))

    np.testing.assert_array_equal(np.isnan(curve), [False, False, True, False, False, True])


@pytest.mark.parametrize('n_samples', [1, 2, MOST_POINTS, 10 * MOST_POINTS])
def test_long_recordings_are_thinned_and_short_ones_are_not(n_samples: int) -> None:
    rows = shown_rows(n_samples)

    assert len(rows) == min(n_samples, MOST_POINTS)
    assert (rows[0], rows[-1]) == (0, n_samples - 1)
    assert len(set(rows.tolist())) == len(rows)


def test_one_sample_is_enough_for_a_report(tmp_path: Path) -> None:
    outcome, uncertainty = assessed(swing(1).select([3]), Knowing())
    assert write_report(tmp_path, outcome, score(outcome), uncertainty, Labels('One')).is_file()
