"""The 1 kHz loop of the benchmarks: what is counted, that torques come."""

from __future__ import annotations

import json
from pathlib import Path
import time

import numpy as np
import pytest
from ros_domain import free_domain

from benchmarks._panda import run_pair
from benchmarks.loop_rate import Timeline
from lip_id_ros.identification import fit
from lip_id_ros.settings import FitSettings

pytest.importorskip('pinocchio', reason='the simulated arm needs pinocchio')


class Clock:
    """Goes on where somebody waits."""

    def __init__(self) -> None:
        self.now = 0.0

    def read(self) -> float:
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += seconds


def test_ticks_come_when_they_are_due_and_late_ones_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = Clock()
    monkeypatch.setattr(time, 'perf_counter', clock.read)
    monkeypatch.setattr(time, 'sleep', clock.wait)
    timeline = Timeline(10, 1.0)
    due = []
    for number in timeline.ticks():
        due.append(clock.now)
        timeline.asked(number)
        timeline.answered(number, True)
        if number == 4:
            clock.wait(2.75)
    np.testing.assert_allclose(due, [1, 2, 3, 4, 5, 7.75, 7.75, 8, 9, 10], atol=1e-6)
    figures = timeline.figures()
    assert figures['lost'] == figures['missed_percent_1'] == 0
    assert figures['robot_late_percent'] == 20.0


def test_late_lost_and_unsafe_answers_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 0.0
    monkeypatch.setattr(time, 'perf_counter', lambda: now)
    timeline = Timeline(4, 1.0)
    for number, (asked, answered) in enumerate([(0.0, 0.25), (1.0, 1.5), (2.0, 4.0)]):
        now = asked
        timeline.asked(number)
        now = answered
        timeline.answered(number, number != 1)
    timeline.answered(-1, False)  # of the time before
    figures = timeline.figures()
    assert (figures['lost'], figures['unsafe']) == (1, 1)
    assert figures['missed_percent_1'] == 50.0  # with the one that was lost
    assert figures['missed_percent_2'] == 25.0
    assert figures['answer_ms_median'] == 500.0
    assert figures['answer_ms_max'] == 2000.0
    assert figures['interval_ms_std'] == pytest.approx(1e3 * np.std([1.25, 2.5]))


def small_model(folder: Path) -> Path:
    """Fit a model of the Panda that is quick and bad."""
    settings = FitSettings(kernel='recursive', subset=20, max_samples=60, iterations=2)
    path = folder / 'model.npz'
    fit(run_pair(7, 0)[0], settings).save(path)
    return path


@pytest.mark.ros
@pytest.mark.slow
def test_torques_come_through_the_middleware(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip('rclpy', reason='needs ROS 2')
    from benchmarks.__main__ import main

    model, figures = small_model(tmp_path), tmp_path / 'figures.json'
    routes = ['stream', 'plan']
    arguments = [
        '--routes',
        *routes,
        '--model',
        str(model),
        '--seconds',
        '1',
        '--json',
        str(figures),
    ]
    with free_domain() as domain:
        monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
        assert main(['loop_rate', '--middlewares', 'rmw_fastrtps_cpp', *arguments]) == 0
    rows = json.loads(figures.read_text())
    assert [row['route'] for row in rows] == routes
    for row in rows:
        assert (row['ticks'], row['unsafe']) == (1000, 0)
        # a robot that a loaded machine leaves without torques does not follow
        assert row['rms_error_mrad'] < 100.0 or row['missed_percent_5'] > 10.0
        # references may be overtaken where the machine is loaded, joint states lost, but not all
        assert row['lost'] < row['ticks']
