"""Contacts and the balance of energy, from joint states and a learned model."""

from lip_id_ros.monitoring.detection import Calibration, Contact, ContactDetector, Deviation
from lip_id_ros.monitoring.external_torque import (
    external_torques,
    ExternalTorque,
    ExternalTorqueObserver,
)
from lip_id_ros.monitoring.observers import EnergyBalance, EnergyMonitor

__all__ = [
    'Calibration',
    'Contact',
    'ContactDetector',
    'Deviation',
    'EnergyBalance',
    'EnergyMonitor',
    'ExternalTorque',
    'ExternalTorqueObserver',
    'external_torques',
]
