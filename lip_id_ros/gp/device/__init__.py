"""The marginal likelihood on an accelerator, by torch; imported only where it is asked for."""

from lip_id_ros.gp.device.likelihood import is_available, likelihood_on, TorchMarginalLikelihood

__all__ = ['TorchMarginalLikelihood', 'is_available', 'likelihood_on']
