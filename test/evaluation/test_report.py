"""The report is complete, correct where it can be checked, and needs no network."""

from __future__ import annotations

import base64
from dataclasses import replace
from html.parser import HTMLParser
import json
from pathlib import Path

from evaluation.stubs import Knowing
from health.recordings import column, sound
from matplotlib.figure import Figure
import numpy as np
import pytest
from simulation.pendulums import swing

from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.evaluation import Outcome, run, score
from lip_id_ros.evaluation.recording_health import RecordingHealth, UNKNOWN_UNITS
from lip_id_ros.evaluation.report import Band, band, figures, Labels, write_report
from lip_id_ros.evaluation.report.recording_report import motion, signals, write_recording_report
from lip_id_ros.evaluation.report.style import broken_at, MOST_POINTS, shown_rows, times
from lip_id_ros.health import evidence_of, health
from lip_id_ros.model import Prediction
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import RecordingSettings

pytestmark = pytest.mark.slow

PICTURES = ('torque', 'errors', 'residual', 'energies', 'torque_split', 'friction')
PNG = b'\x89PNG\r\n\x1a\n'


def assessed(data: Dataset, estimator: Knowing) -> tuple[Outcome, Band]:
    outcome = run(estimator, data)
    uncertainty = band(estimator, outcome)
    assert uncertainty is not None
    return outcome, uncertainty


class Links(HTMLParser):
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
        np.asarray(curves['true'].get_ydata()),
        np.asarray(curves['predicted, potential'].get_ydata()),
    )


def test_friction_is_what_the_links_leave() -> None:
    data = swing(1)
    outcome, _ = assessed(data, Knowing(torque_error=0.1))
    prediction = outcome.prediction
    assert isinstance(prediction, Prediction)
    panel = figures.friction(outcome, prediction).axes[0]
    measured, predicted = (np.asarray(line.get_ydata()) for line in panel.get_lines())
    links = prediction.tau - prediction.friction
    np.testing.assert_allclose(measured, (data.tau - links)[:, 0])
    np.testing.assert_allclose(predicted, 0.1)


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


def test_a_joint_that_is_hardly_predicted_is_called_that_in_pictures() -> None:
    outcome, uncertainty = assessed(swing(1), Knowing())
    evaluation = score(outcome)
    useless = replace(evaluation, nmse_percent=(95.0, *evaluation.nmse_percent[1:]))
    first, second, *_ = figures.torque(outcome, useless, uncertainty).axes
    assert first.get_title('right') == 'hardly better than the mean: nMSE 95 %'
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


def test_pictures_show_every_joint_as_it_was_recorded() -> None:
    samples = sound()
    figure = signals(evidence_of(samples))
    assert len(figure.axes) == 3 * 7
    for number, panel in enumerate(figure.axes):
        joint, column_ = divmod(number, 3)
        values = (samples.position, samples.velocity, samples.effort)[column_][:, joint]
        (line,) = panel.get_lines()
        t, drawn = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        rows = np.searchsorted(samples.t, t)
        np.testing.assert_array_equal(samples.t[rows], t)
        np.testing.assert_array_equal(drawn, values[rows])
        # from the first sample to the last, evenly: a thousand of them, or all
        assert (rows[0], rows[-1]) == (0, samples.n_samples - 1)
        assert len(rows) >= min(1000, samples.n_samples)
        assert np.ptp(np.diff(rows)) <= 1
    covered = motion(evidence_of(samples))
    assert [panel.get_title(loc='left') for panel in covered.axes if panel.get_visible()] == list(
        samples.joint_names
    )


def test_what_was_not_recorded_is_said_in_the_picture() -> None:
    samples = column(sound(), 'effort', 0, np.nan)
    panel = signals(evidence_of(samples)).axes[2]
    assert [text.get_text() for text in panel.texts] == ['not recorded']


@pytest.mark.slow
def test_several_recordings_get_folders(tmp_path: Path) -> None:
    broken = evidence_of(column(sound(), 'effort', 0, 1.0))
    short = evidence_of(
        JointSamples(np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)), ('<a>',))
    )
    pairs = [(evidence, health(evidence)) for evidence in (broken, short)]

    page = write_recording_report(tmp_path, 'my_bag', pairs)

    assert page == tmp_path / '1' / 'index.html'
    first, second = (
        (tmp_path / number / 'index.html').read_text(encoding='utf-8') for number in '12'
    )
    assert 'the effort of arm_joint1 is 1 throughout' in first
    assert first.count('data:image/png;base64,') == 2
    assert second.count('data:image/png;base64,') == 1
    assert '&lt;a&gt;' in second


def test_figures_are_json() -> None:
    described = json.loads(json.dumps(health(evidence_of(sound())), allow_nan=False))
    assert set(described) == {
        'findings', 'joints', 'stale_share', 'effort_lag_s', 'effort_lag_gain'
    }  # fmt: skip
    assert described['joints']['arm_joint1']['velocity_scale'] == pytest.approx(1.0, abs=0.01)


def labels(figure: Figure) -> set[str]:
    return {panel.get_ylabel() for panel in figure.axes} | {
        panel.get_xlabel() for panel in figure.axes
    }


def test_a_prismatic_joint_is_drawn_in_metres_and_an_unknown_one_in_either() -> None:
    recording = RecordingSettings(joints=('arm_joint1',), joint_types=('prismatic',))
    health = RecordingHealth(recording, keep_samples=True)
    health(sound())
    (evidence,) = (evidence for evidence, _ in health.seen)
    assert evidence.joint_types == ('prismatic', *('revolute',) * 6)
    found = labels(signals(evidence))
    assert {'q [m]', 'q [rad]', 'dq [m/s]', 'dq [rad/s]', 'tau [N]', 'tau [N m]'} <= found
    assert 'position [m]' in labels(motion(evidence))
    unknown = labels(signals(evidence, UNKNOWN_UNITS)) | labels(motion(evidence, UNKNOWN_UNITS))
    assert {'q [rad or m]', 'dq [rad/s or m/s]', 'position [rad or m]'} <= unknown
    assert not any('[rad]' in label for label in unknown)


def test_efforts_have_a_unit_where_the_settings_give_their_scale() -> None:
    scaled = RecordingHealth(RecordingSettings(effort_scale=(2.0,) * 7))
    assert (RecordingHealth().are_torques, scaled.are_torques) == (False, True)
    recorded = labels(signals(evidence_of(sound()), are_torques=False))
    assert 'effort' in recorded
    assert not any('N m' in label for label in recorded)
