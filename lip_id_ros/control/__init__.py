"""Computed-torque control: feedforward of the reference's torques, and PD feedback."""

from lip_id_ros.control.computed_torque import (
    ComputedTorque,
    Feedforward,
    Gains,
    LearnedFeedforward,
    NoFeedforward,
    Torques,
)

__all__ = [
    'ComputedTorque',
    'Feedforward',
    'Gains',
    'LearnedFeedforward',
    'NoFeedforward',
    'Torques',
]
