"""One run as a test engineer looks at it: motions, command, base vibration, modes, forces, torques."""

from .run_report import RunReport, report

__all__ = ["RunReport", "report"]
