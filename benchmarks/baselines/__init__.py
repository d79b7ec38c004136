"""Models of the literature and ours, behind one interface, to be compared on the same data."""

from benchmarks.baselines.interface import Baseline, Method
from benchmarks.baselines.registry import method, MODELS, needs_urdf

__all__ = ['MODELS', 'Baseline', 'Method', 'method', 'needs_urdf']
