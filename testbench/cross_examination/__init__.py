"""Cross-examination: what the sensors of a run witness, against the run table, the rig, the model and the other runs.

``observation`` reads a run once, along the motion that ``model_loads`` makes of its encoders; ``conditions``,
``torque_comparison``, ``peak_accelerations``, ``sensors``, ``paths``, ``repeated_vibration``, ``repeated_sizes`` and
``copies`` state what follows; ``examination`` puts it together for a campaign.
"""

from .examination import Examination, examine, hear
from .observation import Observation, observe
from .statement import ADVICE, Statement

__all__ = ["ADVICE", "Examination", "Observation", "Statement", "examine", "hear", "observe"]
