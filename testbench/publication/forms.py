"""Which terms the law needs, asked of the table that is calibrated on, alone: leave one condition out."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from .calibration import fit
from .cases import Cases
from .model import NAMES

COUPLES = tuple(name for name in NAMES if name.startswith("couple_share"))
FORMS = (
    ("residual_mass",),
    ("residual_mass", "flexing"),
    ("residual_mass", "moment_weight"),
    ("residual_mass", "flexing", "moment_weight"),
    ("residual_mass", *COUPLES),
    ("residual_mass", "flexing", *COUPLES),
    ("residual_mass", "moment_weight", *COUPLES),
    ("moment_weight", *COUPLES),
    NAMES,
)
"""Free parameters; the other terms are off."""
_STARTS = 4


@dataclass(frozen=True)
class Form:
    """How a form does on the calibrated table: mean absolute errors [percentage points]."""

    parameters: tuple[str, ...]
    fitted: float
    left_out: float
    """On each condition, its three axes, when calibrated on all other conditions."""


def forms(known: Cases) -> list[Form]:
    """Every form, the one that leaves conditions out best first."""
    return sorted((_form(known, names) for names in FORMS), key=lambda form: form.left_out)


def _form(known: Cases, names: tuple[str, ...]) -> Form:
    fitted = np.abs(fit(known, names).errors).mean()
    errors = np.concatenate([*_left_out(known, names)])
    return Form(names, float(fitted), float(np.abs(errors).mean()))


def _left_out(known: Cases, names: tuple[str, ...]) -> Iterator[Floats]:
    conditions = list(zip(known.payload_kg, known.motion, known.peak_acceleration, strict=True))
    for condition in dict.fromkeys(conditions):
        out = np.array([each == condition for each in conditions])
        asked = known.where(out)
        yield fit(known.where(~out), names, _STARTS).predict(asked) - asked.printed
