"""Computed-torque control: feedforward of the reference's torques, and PD feedback."""

from lip_id_ros.control.computed_torque import (
    ComputedTorque,
    Feedforward,
    Gains,
    LearnedFeedforward,
    NoFeedforward,
    Torques,
)
from lip_id_ros.control.reference import GrowingCosine

__all__ = [
    'ComputedTorque',
    'Feedforward',
    'Gains',
    'GrowingCosine',
    'LearnedFeedforward',
    'NoFeedforward',
    'Torques',
]
