"""Results of made-up fleets, for their page."""

from __future__ import annotations

from evaluation.models import small_model
import numpy as np

from lip_id_ros.fleet.results import EXCLUDED, FAILED, FITTED, FleetResult, RecordingResult

TERMS = ('viscous', 'Coulomb', 'offset')


def made_up(count: int, robots: int = 20) -> FleetResult:
    """Return the result of a fleet whose friction falls with temperature, one of ten left out."""
    model = small_model()
    n = model.n_joints
    names = tuple(f'{joint}: {term}' for joint in model.joint_names for term in TERMS)
    rng = np.random.default_rng(0)
    own = 1.0 + 0.2 * rng.standard_normal((robots, len(names)))
    recordings = []
    for number in range(count):
        robot = number % robots
        status = (EXCLUDED, FAILED)[number // 10 % 2] if number % 10 == 9 else FITTED
        read = np.nan if status == FAILED else 1.0
        temperature = 30.0 + 10.0 * np.sin(number / 30) + rng.standard_normal()
        recordings.append(
            RecordingResult(
                name=f's3://plant/robot{robot:02d}/run{number:05d}.mcap',
                group=f'robot{robot:02d}',
                status=status,
                reason='' if status == FITTED else '</script><b>reason</b> & "more"',
                n_samples=0 if status == FAILED else 1500,
                rate_hz=read * 100.0,
                seconds=read * (10.0 + rng.exponential(20.0)),
                start_s=read * (1.7e9 + 3600.0 * number),
                temperature=read * temperature,
                health=('warning short: record longer.',) if number % 7 == 0 else (),
                residual_rms=read * model.noise_std * (1 + rng.exponential(0.2, n)),
                friction=read * own[robot] * (1 - 0.01 * (temperature - 30.0)),
                friction_std=np.full(len(names), 0.02),
            )
        )
    spread = np.full(len(names), 0.02)
    return FleetResult(model, tuple(recordings), names, model.noise_std, spread, 10 * spread)
