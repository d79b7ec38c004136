"""Rigid-body dynamics of serial chains: spatial algebra, RNEA, its regressor and derivatives."""

from lip_id_ros.rigid_body.chain import Chain, LINK_PARAMETERS, STANDARD_GRAVITY

__all__ = ['LINK_PARAMETERS', 'STANDARD_GRAVITY', 'Chain']
