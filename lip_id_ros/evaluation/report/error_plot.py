"""The errors as bars."""

from __future__ import annotations

import math

from matplotlib.figure import Figure
import numpy as np

from lip_id_ros.evaluation.evaluation import Evaluation
from lip_id_ros.evaluation.report import style

LEAST_SHOWN = 1e-6  # percent; a bar on a logarithmic axis needs some length

Bar = tuple[str, float, str]


def errors(evaluation: Evaluation) -> Figure:
    """Draw the normalized mean squared error of each torque and energy as a bar."""
    bars = _bars(evaluation)
    labels, values, colors = zip(*bars, strict=True)
    shown = np.maximum(np.nan_to_num(values), LEAST_SHOWN)
    figure = Figure(figsize=(style.WIDTH, 0.42 * len(bars) + 1.0), layout='constrained')
    panel = figure.subplots()
    drawn = panel.barh(labels, shown, color=colors, height=0.62)
    panel.bar_label(drawn, labels=[_label(value) for value in values], padding=5)
    panel.set_xscale('log')
    panel.set_xlim(min(1e-2, shown.min()) / 3, max(1.0, shown.max()) * 4)
    panel.invert_yaxis()
    panel.grid(visible=False, axis='y')
    panel.set_xlabel('normalized mean squared error [%]')
    return figure


def _bars(evaluation: Evaluation) -> list[Bar]:
    energies = (
        ('kinetic energy', evaluation.kinetic_nmse_percent, style.KINETIC),
        ('potential energy', evaluation.potential_nmse_percent, style.POTENTIAL),
    )
    joints = zip(evaluation.joint_names, evaluation.nmse_percent, strict=True)
    return [
        *((name, value, style.PREDICTED) for name, value in joints),
        *((name, value, color) for name, value, color in energies if value is not None),
    ]


def _label(value: float) -> str:
    return 'does not vary' if math.isnan(value) else f'{value:.3g} %'
