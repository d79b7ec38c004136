"""Gaussian process regression: marginal likelihood, optimisation, conditioning."""

from lip_id_ros.gp.fitting import fit_process, FittedProcess

__all__ = ['FittedProcess', 'fit_process']
