"""Several recordings of an arm whose reported positions are coupled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fleet.fleets import arm_of, friction_of, friction_torque, PlainEngine, recording, save
import numpy as np
import pytest

from lip_id_ros.fleet.fit import fit_fleet
from lip_id_ros.rigid_body.couplings import Coupling, couplings_of, rows_of
from lip_id_ros.settings import Config, FitSettings

TYPES = ('revolute',) * 3
COUPLING = Coupling(2, 1, -1.0)


@pytest.mark.slow
@pytest.mark.xdist_group('fleet')
@pytest.mark.parametrize('texts', [(), ('joint_2 -1 joint_1',)])
def test_coupled_positions_of_several_recordings(texts: tuple[str, ...], tmp_path: Path) -> None:
    """Found in the default fit, and taken as they are given."""
    serial, rng = arm_of(3, TYPES), np.random.default_rng(0)
    arm = replace(serial, chain=serial.chain._replace(couplings=rows_of((COUPLING,))))
    friction = friction_of(arm, rng, 0.3)
    sources = [
        save(recording(arm, friction, seed), tmp_path / f'{seed}.npz', f'robot {seed}')
        for seed in range(4)
    ]
    model = fit_fleet(sources, Config(fit=FitSettings(coupling=texts)), PlainEngine()).model
    assert model.arm is not None
    assert couplings_of(model.arm.chain.couplings) == (COUPLING,)
    test = recording(arm, friction, 99)
    found = model.predict(test.q, test.dq, test.ddq, return_std=True)
    tau = arm.torque(test.q, test.dq, test.ddq) + friction_torque(friction, test.dq)
    errors = np.sqrt(np.mean((found.tau - tau) ** 2, axis=0))
    assert (errors < 0.02 * tau.std(axis=0)).all()
    assert found.std is not None
    assert (np.abs(found.tau - tau) < 3.0 * found.std.tau).mean() > 0.95
