"""Parameters of a mechanism from the positions, torques and forces of runs."""

from .identification import identify
from .records import JointRecord, joint_record
from .result import CounterMassValue, Identification, Value

__all__ = ["CounterMassValue", "Identification", "JointRecord", "Value", "identify", "joint_record"]
