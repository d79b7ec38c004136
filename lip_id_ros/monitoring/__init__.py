"""What the learned energies tell while the arm moves: its energy balance, and who touches it."""

from lip_id_ros.monitoring.contact import ContactObserver, external_torques
from lip_id_ros.monitoring.detection import ContactMonitor, sudden_part, Thresholds, Touch
from lip_id_ros.monitoring.energy import EnergyBalance, EnergyMonitor

__all__ = [
    'ContactMonitor',
    'ContactObserver',
    'EnergyBalance',
    'EnergyMonitor',
    'Thresholds',
    'Touch',
    'external_torques',
    'sudden_part',
]
