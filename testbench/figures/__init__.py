"""Figures of runs, like those of the manipulator tests; a figure of simulated runs says so."""

from .reductions import reductions
from .runs import base_acceleration, base_spectrum, command_performance, force_sensors, motor_torques

__all__ = ["base_acceleration", "base_spectrum", "command_performance", "force_sensors", "motor_torques", "reductions"]
