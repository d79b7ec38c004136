"""Methods by name."""

from __future__ import annotations

import numpy as np
import pytest
from simulation.panda_runs import runs
from torch_later import needs_torch

from benchmarks.baselines import method, MODELS
from lip_id_ros.errors import ConfigError
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation.arm import panda_urdf


@pytest.mark.parametrize('name', ['rigid_body', 'semiparametric'])
def test_kinematics_are_asked_for(name: str) -> None:
    with pytest.raises(ConfigError, match=f"'{name}' needs the kinematics .* name its URDF file"):
        method(name)


@needs_torch
@pytest.mark.slow
@pytest.mark.parametrize('name', [name for name in MODELS if name != 'delan'])
def test_every_model_answers(name: str) -> None:
    pytest.importorskip('pinocchio')
    data, unseen = runs(2, 40)
    settings = FitSettings(subset=20, iterations=2)
    stages = []
    learned = method(name, panda_urdf()).fit(
        data, settings, lambda stage, done, total: stages.append((done, total))
    )
    assert all(done <= total for done, total in stages if total)
    assert stages
    assert learned.size > 0
    found = learned.predict(unseen.q, unseen.dq, unseen.ddq)
    one = learned.predict(unseen.q[:1], unseen.dq[:1], unseen.ddq[:1])
    assert found.tau.shape == unseen.tau.shape
    assert np.isfinite(found.tau).all()
    np.testing.assert_allclose(one.tau, found.tau[:1], rtol=1e-6, atol=1e-6)
    for energy in (found.kinetic, found.potential):
        assert energy is None or energy.shape == (unseen.n_samples,)
