"""Gaussian process regression: marginal likelihood, optimisation, conditioning."""

from lip_id_ros.gp.fitting import fit

__all__ = ['fit']
