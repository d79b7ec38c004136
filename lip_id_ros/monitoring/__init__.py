"""Contacts and the balance of energy, from joint states and a learned model."""

from lip_id_ros.monitoring.detection import ContactEstimate, ContactMonitor, Thresholds
from lip_id_ros.monitoring.observers import (
    ContactObserver,
    EnergyBalance,
    EnergyMonitor,
    external_torques,
)

__all__ = [
    'ContactEstimate',
    'ContactMonitor',
    'ContactObserver',
    'EnergyBalance',
    'EnergyMonitor',
    'Thresholds',
    'external_torques',
]
