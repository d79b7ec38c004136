"""One self-contained page about a fleet: map of recordings, friction over time, tables."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from importlib.resources import files
import json
import os
from typing import Any

import numpy as np

from lip_id_ros.errors import printable
from lip_id_ros.evaluation.cautions import fit_cautions
from lip_id_ros.evaluation.report.page import for_page, MAKER, STYLE
from lip_id_ros.files import write_whole
from lip_id_ros.fleet.results import EXCLUDED, FAILED, FITTED, FleetResult, HELD_OUT

FIRST_CLOCK_S = 1e8
"""Times before this are of no clock that knows the time of day: logs begin at zero."""


def write_fleet_report(
    path: str | os.PathLike[str], result: FleetResult, name: str = 'model'
) -> None:
    """
    Write the page, which needs no network.

    `path`: file to be written or replaced. `name`: of the model, for the title. OSError if the
    file cannot be written.
    """
    write_whole(path, _page(result, f'{name}: several recordings').encode())


def _page(result: FleetResult, title: str) -> str:
    page = (files(__package__) / 'report.html').read_text(encoding='utf-8')
    # nothing in a text may end the script
    page = page.replace('DATA', json.dumps(_data(result)).replace('<', '\\u003c'), 1)
    page = page.replace('MAKER', MAKER, 1).replace('STYLE', STYLE, 1)
    return page.replace('TITLE', for_page(title), 2)


def _data(result: FleetResult) -> dict[str, Any]:
    """Return what the page shows, by columns, since that is short."""
    recordings = result.recordings
    groups = sorted({each.group for each in recordings})
    number_of = {group: number for number, group in enumerate(groups)}
    return {
        'joints': _texts(result.model.joint_names),
        'warnings': _texts(fit_cautions(result.model, result.evaluation)),
        'noise': result.noise_std.tolist(),
        'terms': _texts(result.friction_names),
        'betweenRecordings': np.nan_to_num(result.deviation_of_recordings).tolist(),
        'betweenRobots': np.nan_to_num(result.deviation_of_groups).tolist(),
        'groups': _texts(groups),
        'statuses': [FITTED, EXCLUDED, FAILED, HELD_OUT],
        'names': _texts(each.name for each in recordings),
        'group': [number_of[each.group] for each in recordings],
        'status': [each.status for each in recordings],
        'reasons': _texts(each.reason for each in recordings),
        'health': [_texts(each.health) for each in recordings],
        'samples': _packed([each.n_samples for each in recordings]),
        'rate': _packed([each.rate_hz or np.nan for each in recordings]),
        'seconds': _packed([each.seconds for each in recordings]),
        'start': _packed([_time_of_day(each.start_s) for each in recordings]),
        'temperature': _packed([each.temperature for each in recordings]),
        'residual': _packed([each.residual_rms for each in recordings]),
        'friction': _packed([each.friction for each in recordings]),
        'std': _packed([each.friction_std for each in recordings]),
    }


def _time_of_day(start_s: float) -> float:
    return start_s if start_s > FIRST_CLOCK_S else np.nan


def _texts(texts: Iterable[str]) -> list[str]:
    return [printable(text) for text in texts]


def _packed(values: Any) -> str:
    """Return numbers as text that a page reads at once, nan too."""
    return base64.b64encode(np.asarray(values, dtype='<f8').tobytes()).decode('ascii')
