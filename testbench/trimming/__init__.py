"""What first moment is missing on which arm, and which mass to add, from the runs of a mechanism."""

from .load_regression import CUTOFF_HZ
from .missing_masses import trim_runs
from .problem import Source
from .result import Share, Trim

__all__ = ["CUTOFF_HZ", "Share", "Source", "Trim", "trim_runs"]
