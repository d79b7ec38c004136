"""Identification of arms from recordings: chain, links, friction and residual GP."""

from lip_id_ros.identification.fitting import fit

__all__ = ['fit']
