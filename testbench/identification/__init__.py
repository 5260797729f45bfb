"""Parameters of a mechanism from the positions, torques and forces of runs."""

from .identification import STEPS, identify
from .records import JointRecord, joint_record
from .result import CounterMassValue, Identification, Value

__all__ = ["STEPS", "CounterMassValue", "Identification", "JointRecord", "Value", "identify", "joint_record"]
