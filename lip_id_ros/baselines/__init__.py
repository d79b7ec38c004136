"""Models of the literature and ours, behind one interface, to be compared on the same data."""

from lip_id_ros.baselines.interface import Baseline, FitRecord, Method
from lip_id_ros.baselines.registry import learn, LITERATURE, method, MODELS, needs_urdf, OURS

__all__ = [
    'LITERATURE',
    'MODELS',
    'OURS',
    'Baseline',
    'FitRecord',
    'Method',
    'learn',
    'method',
    'needs_urdf',
]
