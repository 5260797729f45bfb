"""The methods side by side, by what was stated beforehand: error on held-out stretches, of torque and of angles.

The same cut-off, delay, stretches and starting states for all of them; each stretch predicted without it. Torque error:
torque as recorded against the model along the recorded motion. Angle error: see ``simulation``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats
from balance.errors import ModelError
from balance.estimation.identifiability import Identifiability
from balance.mechanism import Mechanism

from .choice import Choice, unexplained
from .methods import NAMES, Method, allowed
from .simulation import Strayed, strayed


@dataclass(frozen=True)
class Compared:
    """One method's errors on held-out stretches."""

    method: Method
    torque: Floats
    """Part of each row as recorded that stays unexplained, (rows,)."""
    angles: Strayed | None
    """None where nothing is simulated forward: loops, or no torques."""

    @property
    def torque_error(self) -> float:
        """Rms over the rows."""
        return float(np.sqrt(np.mean(self.torque**2)))

    def document(self, rows: Sequence[str], joints: tuple[str, ...]) -> Mapping[str, object]:
        """For the JSON document."""
        return {
            "method": self.method,
            "name": NAMES[self.method],
            "held_out_torque_rms_ratio": self.torque_error,
            "by_row": dict(zip(rows, self.torque.tolist(), strict=True)),
            "simulated_angle_error_rad": None
            if self.angles is None
            else {"all_rms": self.angles.whole} | dict(self.angles.document(joints)),
        }


def compare(choice: Choice, mechanism: Mechanism, identifiable: Identifiability) -> list[Compared]:
    """All methods that the records allow, at the choice's cut-off and delay."""
    evidence, delay = choice.evidence, choice.chosen.delay
    held_out = choice.held_out
    methods = allowed(evidence)
    found = [held_out.parameters(delay, method) for method in methods]
    angles = _strayed(choice, mechanism, identifiable, found)
    rows = evidence.torque(delay)
    shares = [unexplained(rows, held_out.predict(one, held_out.columns), evidence.moving) for one in found]
    return [Compared(*each) for each in zip(methods, shares, angles, strict=True)]


def _strayed(
    choice: Choice, mechanism: Mechanism, identifiable: Identifiability, found: Sequence[Floats]
) -> Sequence[Strayed | None]:
    if not choice.evidence.parts[0].record.torque.shape[1]:
        return [None] * len(found)
    try:
        return strayed(choice.evidence, mechanism, identifiable.pivots, found, choice.chosen.delay)
    except ModelError:
        return [None] * len(found)
