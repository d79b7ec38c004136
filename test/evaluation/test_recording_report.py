"""The page on the health of a recording."""

from __future__ import annotations

import json
from pathlib import Path

from health.recordings import column, sound
from matplotlib.figure import Figure
import numpy as np
import pytest

from lip_id_ros.evaluation.recording_health import RecordingHealth, UNKNOWN_UNITS
from lip_id_ros.evaluation.report.recording_report import motion, signals, write_recording_report
from lip_id_ros.health import evidence_of, health
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import RecordingSettings


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
