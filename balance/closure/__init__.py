"""Closing loops: degrees of freedom, closed configurations, whole trajectories on one assembly branch."""

from .loop_closure import Closure, independent_rows
from .trajectory import Trajectory

__all__ = ["Closure", "Trajectory", "independent_rows"]
