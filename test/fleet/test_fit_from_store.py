"""A fit from an object store, on a Ray cluster, is that from the disk, in one process."""

from __future__ import annotations

import os
from pathlib import Path
import sys

from fleet.fleets import arm_of, friction_of, recording, save
from fleet.stores import object_store, upload
import numpy as np
from numpy.testing import assert_array_equal
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.fleet.engines import LocalEngine, RayEngine
from lip_id_ros.fleet.fit import fit_fleet
from lip_id_ros.fleet.results import FITTED, FleetResult
from lip_id_ros.fleet.sources import find
from lip_id_ros.settings import Config

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group('fleet')]

GROUP, ROBOTS = r'robot_(\d)', 4


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place, rng, arm = tmp_path_factory.mktemp('recordings'), np.random.default_rng(0), arm_of()
    for robot in range(ROBOTS):
        data = recording(arm, friction_of(arm, rng, 0.3), seed=robot)
        save(data, place / f'robot_{robot}.npz', str(robot))
    return place


@pytest.fixture(scope='module')
def plain(folder: Path) -> tuple[FleetResult, dict[str, bytes]]:
    """Fit from the disk in one process; return its result, and what it kept of its placements."""
    cache = dict[str, bytes]()
    with LocalEngine(1) as engine:
        result = fit_fleet(find([str(folder)], GROUP), Config(), engine, cache)
    placements = {key: each for key, each in cache.items() if key.endswith('.placements')}
    assert len(placements) == 1
    return result, placements


def parameters(result: FleetResult) -> Array:
    arm = result.model.arm
    assert arm is not None
    own = np.array([each.friction for each in result.recordings])
    return np.concatenate([arm.links.ravel(), arm.friction.coefficients, own.ravel()])


def test_a_fit_from_a_store_on_ray_is_that_from_the_disk(
    folder: Path,
    plain: tuple[FleetResult, dict[str, bytes]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip('ray', reason='Ray is not installed')
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(filter(None, sys.path)))
    disk, placements = plain
    with object_store() as url:
        upload(folder, url)
        with RayEngine(jobs=2) as engine:
            # placements have the same key from both, since contents are the same
            stored = fit_fleet(find([f'{url}/'], GROUP), Config(), engine, dict(placements))
    assert [each.status for each in stored.recordings] == [FITTED] * ROBOTS
    assert all(each.name.startswith('s3://') for each in stored.recordings)
    assert_array_equal(parameters(stored), parameters(disk))
