from __future__ import annotations

import base64
from dataclasses import replace
import json
from pathlib import Path
import re

from fleet.results import made_up
import numpy as np

from lip_id_ros.cli.output import is_page
from lip_id_ros.fleet.report import write_fleet_report


def data_of(page: str) -> dict[str, list[str] | str]:
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    data: dict[str, list[str] | str] = json.loads(text)
    return data


def test_the_page_holds_what_came_of_each_recording(tmp_path: Path) -> None:
    result = made_up(40)
    write_fleet_report(tmp_path / 'fleet.html', result, 'arm <7> DATA')
    page = (tmp_path / 'fleet.html').read_text()
    assert '<title>arm &lt;7&gt; DATA: several recordings</title>' in page
    assert 'http' not in page.replace('http-equiv', '')
    data = data_of(page)
    assert data['names'] == [each.name for each in result.recordings]
    assert data['reasons'] == [each.reason for each in result.recordings]
    friction = np.frombuffer(base64.b64decode(str(data['friction']))).reshape(40, -1)
    np.testing.assert_array_equal(friction, [each.friction for each in result.recordings])
    np.testing.assert_array_equal(data['betweenRecordings'], result.deviation_of_recordings)
    np.testing.assert_array_equal(data['betweenRobots'], result.deviation_of_groups)


def test_a_log_has_no_time_of_day(tmp_path: Path) -> None:
    result = made_up(3)
    first, *others = result.recordings
    log = replace(first, start_s=0.0)
    write_fleet_report(tmp_path / 'fleet.html', replace(result, recordings=(log, *others)))
    page = data_of((tmp_path / 'fleet.html').read_text())
    start = np.frombuffer(base64.b64decode(str(page['start'])))
    np.testing.assert_array_equal(start, [np.nan, *(each.start_s for each in others)])


def test_the_page_warns_of_joints_that_are_not_explained(tmp_path: Path) -> None:
    result = made_up(3)
    shares = [99.0, *[1.0] * (result.model.n_joints - 1)]
    poor = replace(result.model, summary={**result.model.summary, 'unexplained_percent': shares})
    write_fleet_report(tmp_path / 'fleet.html', replace(result, model=poor))
    page = (tmp_path / 'fleet.html').read_text()
    warning = data_of(page)['warnings'][0]
    assert f'hardly better than the mean of the torque at 1 of {len(shares)} joints' in warning


def test_a_page_is_known_by_its_maker(tmp_path: Path) -> None:
    write_fleet_report(tmp_path / 'fleet.html', made_up(3))
    (tmp_path / 'other.html').write_text('<html></html>')
    assert is_page(tmp_path / 'fleet.html')
    assert not is_page(tmp_path / 'other.html')
