"""Rigid links whose joint placements are known or learned: torques linear in their parameters."""

from lip_id_ros.kernels.rigid_links.chain import Chain, PARAMETERS
from lip_id_ros.kernels.rigid_links.links import ARTICULATED, RigidLinks

__all__ = ['ARTICULATED', 'PARAMETERS', 'Chain', 'RigidLinks']
