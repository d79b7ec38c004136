"""What the learned energies tell while the arm moves: its energy balance, and who touches it."""

from lip_id_ros.monitoring.contact import ContactObserver, external_torques, Thresholds
from lip_id_ros.monitoring.energy import EnergyBalance, EnergyMonitor

__all__ = [
    'ContactObserver',
    'EnergyBalance',
    'EnergyMonitor',
    'Thresholds',
    'external_torques',
]
