"""Every page that the tools write shows all its figures in a browser that has no network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
import json
import os
from pathlib import Path
import sys
from threading import Thread
from typing import Any

from evaluation.stubs import Knowing
from excitation.test_next_motion import found
from fleet.results import made_up
from health.recordings import sound
from matplotlib.image import imread
import pytest
from simulation.pendulums import swing
from waiting import run_to_end

from lip_id_ros.evaluation import run, score
from lip_id_ros.evaluation.report import band, Labels, write_report
from lip_id_ros.evaluation.report.recording_report import write_recording_report
from lip_id_ros.excitation.report import write_motion_report
from lip_id_ros.fleet.report import write_fleet_report
from lip_id_ros.health import evidence_of, health

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
BROWSER = Path(__file__).with_name('browser.py')
WITHOUT_A_WINDOW = {'QT_QPA_PLATFORM': 'offscreen', 'QTWEBENGINE_DISABLE_SANDBOX': '1'}
LABELS = Labels('Title', ['Beware.'], [('recording', 'a' * 200)])


def seen(page: Path, url: str = '') -> dict[str, Any] | None:
    command = [sys.executable, str(BROWSER), url or str(page)]
    looked = run_to_end(command, page.parent, env={**os.environ, **WITHOUT_A_WINDOW})
    assert looked.returncode == 0, looked.stderr
    found: dict[str, Any] | None = json.loads(looked.stdout)
    return found


def evaluation(folder: Path) -> Path:
    estimator = Knowing(torque_error=0.1)
    outcome = run(estimator, swing(1))
    uncertainty = band(estimator, outcome)
    return write_report(folder, outcome, score(outcome), uncertainty, LABELS)


def recording(folder: Path) -> Path:
    evidence = evidence_of(sound())
    return write_recording_report(folder, 'bag', [(evidence, health(evidence))])


def motion(folder: Path) -> Path:
    designed = found()
    return write_motion_report(folder, designed)


@pytest.mark.parametrize(
    ('write', 'count'),
    [(evaluation, 6), (recording, 2), (motion, 1)],
)
def test_every_figure_is_shown_without_a_network(
    tmp_path: Path, write: Callable[[Path], Path], count: int
) -> None:
    page = write(tmp_path)
    found = seen(page)
    assert found is not None

    written = [imread(path).shape[:2] for path in page.parent.glob('*.png')]
    assert len(found['images']) == len(written) == count
    shown = [image['size'] for image in found['images']]
    assert sorted(shown) == sorted([width, height] for height, width in written)
    for image in found['images']:
        assert image['embedded']
        assert image['shown']
        assert image['colours'] > 10
    assert found['refused'] == []
    assert found['console'] == []
    assert found['overflow'] <= 0


@pytest.mark.parametrize(('count', 'most_rows'), [(20, 40), (10_000, 60)])
def test_the_page_of_a_fleet_draws_all_and_holds_the_rows_in_sight(
    tmp_path: Path, count: int, most_rows: int
) -> None:
    page = tmp_path / 'fleet.html'
    write_fleet_report(page, made_up(count))
    found = seen(page)
    assert found is not None
    assert len(found['canvases']) == 2
    assert min(found['canvases']) > 10
    assert 20 < found['rows'] <= most_rows
    assert found['refused'] == []
    assert found['console'] == []
    assert found['overflow'] <= 0


@pytest.mark.parametrize(
    ('count', 'robot', 'summary'),
    [
        (1, 'robot00', '1 recording of 1 robot: 1 fitted, 0 excluded, 0 failed.'),
        (2, '', '2 recordings: 2 fitted, 0 excluded, 0 failed.'),
    ],
)
def test_the_page_of_a_fleet_counts(tmp_path: Path, count: int, robot: str, summary: str) -> None:
    result = made_up(count)
    of_one = tuple(replace(each, group=robot) for each in result.recordings)
    write_fleet_report(tmp_path / 'fleet.html', replace(result, recordings=of_one))
    found = seen(tmp_path / 'fleet.html')
    assert found is not None
    assert found['summary'] == summary
    assert found['console'] == []


class Silent(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture(scope='module')
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if not (ROOT / '.deps' / 'docs.stamp').exists():
        pytest.skip('needs the tools of requirements-docs.txt; make setup brings them')
    folder = tmp_path_factory.mktemp('site')
    built = run_to_end([str(ROOT / 'scripts' / 'docs.sh'), str(folder / 'html')], folder)
    assert built.returncode == 0, built.stderr
    return folder / 'html'


@pytest.mark.parametrize(
    ('name', 'title', 'least'),
    [
        ('index', 'lip_id_ros', 0),
        ('tutorials/first-model', 'A first model in five minutes', 1),
        ('how-to/read-a-report', 'Read a report', 1),
        ('reference/api', 'Python API', 0),
    ],
)
def test_the_site_is_built_without_a_warning_and_shows_its_pictures(
    site: Path, name: str, title: str, least: int
) -> None:
    serving = ThreadingHTTPServer(('127.0.0.1', 0), partial(Silent, directory=str(site)))
    with serving as server:
        Thread(target=server.serve_forever, daemon=True).start()
        url = f'http://127.0.0.1:{server.server_port}/{name}.html'
        found = seen(site / f'{name}.html', url)
        server.shutdown()
    assert found is not None
    assert title in found['title']
    assert len(found['images']) >= least
    assert all(image['shown'] for image in found['images'])
    assert found['refused'] == []
    assert found['console'] == []
    assert found['overflow'] <= 0


def test_tutorials_show_what_they_printed(site: Path) -> None:
    page = (site / 'tutorials' / 'first-model.html').read_text(encoding='utf-8')
    assert 'within 2 std' in page
    assert 'Traceback' not in page
