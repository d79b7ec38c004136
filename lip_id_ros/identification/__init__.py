"""Identification of arms from recordings: chain, links, friction and remainder."""

from lip_id_ros.identification.fitting import fit

__all__ = ['fit']
