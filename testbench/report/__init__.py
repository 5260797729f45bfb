"""One run as a test engineer looks at it: motions, command, base vibration, modes, forces, torques."""

from .run import RunReport, report

__all__ = ["RunReport", "report"]
