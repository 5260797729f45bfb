"""Figures of runs, as the source of the manipulator tests shows them; every one of simulated runs says so."""

from .command import command_performance
from .loads import force_sensors, motor_torques
from .reductions import reductions
from .spectrum import base_spectrum
from .vibration import base_acceleration

__all__ = ["base_acceleration", "base_spectrum", "command_performance", "force_sensors", "motor_torques", "reductions"]
