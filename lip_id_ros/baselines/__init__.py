"""Estimators of the literature beside ours, behind one interface, to be compared on same data."""

from lip_id_ros.baselines.interface import Answer, Estimator, Method
from lip_id_ros.baselines.registry import method, MODELS, needs_urdf

__all__ = ['MODELS', 'Answer', 'Estimator', 'Method', 'method', 'needs_urdf']
