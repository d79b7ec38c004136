"""The errors as bars."""

from __future__ import annotations

import math

from matplotlib.figure import Figure

from lip_id_ros.evaluation.evaluation import Evaluation
from lip_id_ros.evaluation.report import style

LEAST_SHOWN = 1e-6  # percent; a bar on a logarithmic axis needs some length


def errors(evaluation: Evaluation) -> Figure:
    """Draw the normalized mean squared error of each torque and energy as a bar."""
    bars = [
        *((name, value, style.PREDICTED) for name, value in _joints(evaluation)),
        *_energies(evaluation),
    ]
    labels, values, colors = zip(*bars, strict=True)
    figure = Figure(figsize=(style.WIDTH, 0.42 * len(bars) + 1.0), layout='constrained')
    panel = figure.subplots()
    shown = [max(value, LEAST_SHOWN) for value in values]
    drawn = panel.barh(labels, shown, color=colors, height=0.62)
    panel.bar_label(drawn, labels=[f'{value:.3g} %' for value in values], padding=5)
    panel.set_xscale('log')
    panel.set_xlim(min(1e-2, min(shown)) / 3, max(1.0, max(shown)) * 4)
    panel.invert_yaxis()
    panel.grid(visible=False, axis='y')
    panel.set_xlabel('normalized mean squared error [%]')
    return figure


def _joints(evaluation: Evaluation) -> list[tuple[str, float]]:
    pairs = zip(evaluation.joint_names, evaluation.nmse_percent, strict=True)
    return [(name, value) for name, value in pairs if not math.isnan(value)]


def _energies(evaluation: Evaluation) -> list[tuple[str, float, str]]:
    bars = (
        ('kinetic energy', evaluation.kinetic_nmse_percent, style.KINETIC),
        ('potential energy', evaluation.potential_nmse_percent, style.POTENTIAL),
    )
    return [
        (name, value, color)
        for name, value, color in bars
        if value is not None and not math.isnan(value)
    ]
