"""The report of one run: motions, command, base vibration, modes, response, forces, torques."""

from .run_report import RunReport, report

__all__ = ["RunReport", "report"]
