"""Draw the joint axes that a fit finds in a simulated Panda's torques, beside the true ones."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks._panda import run_pair
from lip_id_ros.arrays import Array
from lip_id_ros.description.urdf import load_description
from lip_id_ros.identification import fit
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.denavit_hartenberg import Pose, poses, with_standard_frames
from lip_id_ros.simulation.arm import panda_urdf

AXIS_M = 0.12
"""Length at which an axis is drawn."""
REACH_M = 0.36
"""From the middle of the arm to the ends of the view."""


def main(arguments: list[str]) -> int:
    """Fit a simulated Panda without its URDF, and draw both arms."""
    parser = argparse.ArgumentParser(prog='benchmarks kinematics_picture', description=__doc__)
    parser.add_argument('-o', '--output', type=Path, default=Path('docs/images/kinematics.png'))
    parser.add_argument('--joints', type=int, default=7)
    options = parser.parse_args(arguments)
    training, _ = run_pair(options.joints, seed=0)
    model = fit(training)
    assert model.arm is not None
    known = load_description(panda_urdf(), training.joint_names, training.joint_types)
    true, _ = with_standard_frames(known.chain, known.links)
    found, _ = with_standard_frames(model.arm.chain, model.arm.links)
    figure = plt.figure(figsize=(8.0, 4.5), layout='constrained')
    arms = [_frames(chain) for chain in (true, found)]
    arms[1] = _turned(arms[1], arms[0])
    views = zip(('true (URDF)', 'found in torques'), arms, strict=True)
    for k, (title, frames) in enumerate(views, start=1):
        axes = figure.add_subplot(1, 2, k, projection='3d')
        _draw(axes, frames)
        axes.set_title(title)
    names, lines = axes.get_legend_handles_labels()[::-1]
    figure.legend(lines, names, loc='outside lower center', ncol=len(names), fontsize='small')
    figure.savefig(options.output, dpi=120)
    print(f'Written: {options.output}')
    return 0


def _frames(chain: Chain) -> Pose:
    """Return the frames of an arm, the first one at the origin."""
    frames = poses(chain)
    return frames._replace(origin=frames.origin - frames.origin[0])


def _turned(frames: Pose, like: Pose) -> Pose:
    """Turn an arm about the vertical, which torques do not determine, to lie as another."""
    x, y = frames.origin[:, :2].T @ like.origin[:, :2]
    turn = Rotation.from_euler('z', np.arctan2(x[1] - y[0], x[0] + y[1])).as_matrix()
    return Pose(turn @ frames.axes, frames.origin @ turn.T)


def _draw(axes: Any, frames: Pose) -> None:
    """Draw links as lines between the frames, and each joint's axis through its frame."""
    origins: Array = frames.origin
    axes.plot(*origins.T, color='0.6', linewidth=2.0)
    for i, (origin, rotation) in enumerate(zip(origins, frames.axes, strict=True)):
        ends = np.stack([origin - AXIS_M * rotation[:, 2], origin + AXIS_M * rotation[:, 2]])
        axes.plot(*ends.T, color=f'C{i}', linewidth=2.0, label=f'joint {i + 1}')
    middle = 0.5 * (origins.max(axis=0) + origins.min(axis=0))
    for limits, centre in zip(('x', 'y', 'z'), middle, strict=True):
        getattr(axes, f'set_{limits}lim')(centre - REACH_M, centre + REACH_M)
        getattr(axes, f'set_{limits}label')(f'{limits} [m]')
        axes.locator_params(nbins=4)
    axes.view_init(elev=18.0, azim=-65.0)
