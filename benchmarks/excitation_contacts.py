"""
Contacts with a floor and a wall over seeds, in designed motions (excitation.md).

MuJoCo moves the arm along motions of the full size that were designed with its URDF.

"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks._mujoco_arm import Arm, Cell, description, STEP_S
from benchmarks.from_nothing import CELLS, motion_of, SEARCH, space_of
from lip_id_ros.excitation.planning import design_motion
from lip_id_ros.excitation.settings import ExcitationConfig, SearchSettings, SpaceSettings


def main(arguments: list[str]) -> int:
    """Print the number of seeds with contacts of each arm."""
    parser = argparse.ArgumentParser(prog='benchmarks excitation_contacts', description=__doc__)
    parser.add_argument('--robots', nargs='+', choices=CELLS, default=list(CELLS))
    parser.add_argument('--seeds', type=int, default=30)
    options = parser.parse_args(arguments)
    for robot in options.robots:
        counts = [contacts(CELLS[robot], seed) for seed in range(options.seeds)]
        touched = sum(each > 0 for each in counts)
        print(f'| {robot} | {touched} of {len(counts)} |', flush=True)
    return 0


def contacts(cell: Cell, seed: int) -> int:
    """Return at how many steps of a designed motion the arm touches floor or wall."""
    text = description(Path(cell.urdf), cell.joints)
    arm = Arm(cell, text)
    motion = design_motion(_config(cell, arm, seed), urdf=text).motion
    t = motion.times(1.0 / STEP_S)
    arm.begin(t, np.stack(motion.sample(t), axis=1))
    for _ in t:
        arm.step()
    return arm.contacts


def _config(cell: Cell, arm: Arm, seed: int) -> ExcitationConfig:
    return ExcitationConfig(
        motion_of(cell, arm),
        SpaceSettings(**space_of(cell)),
        SearchSettings(**SEARCH, seed=seed),
    )
