"""How far predictions are off: on what was calibrated on, on what was held out, and each payload left out in turn."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from balance.arrays import Floats

from .baselines import BASELINES
from .calibration import fit
from .cases import AXES, Cases
from .posterior import marginalise

Calibrated = Callable[[Cases], Floats]
"""Predicts the reductions of cases [%], (n,)."""


def marginalised(known: Cases) -> Calibrated:
    """Calibrated on known cases: the median over all that these leave open."""
    posterior = marginalise(known)
    return lambda asked: posterior.predict(asked)[0]


WAYS: dict[str, Callable[[Cases], Calibrated]] = {
    "model": marginalised,
    "model, best fit alone": lambda known: fit(known).predict,
    **{name: partial(partial, baseline) for name, baseline in BASELINES.items()},
}
"""From known cases to what predicts others."""


@dataclass(frozen=True)
class Score:
    """Mean absolute errors of one way to predict [percentage points]."""

    name: str
    calibrated_on: float
    """On the numbers that it was calibrated on."""
    held_out: float
    """On all other payloads."""
    leave_one_payload_out: dict[float, float]
    """On each payload when calibrated on all others, by payload [kg]."""

    @property
    def left_out(self) -> float:
        """Mean over the payloads left out."""
        return float(np.mean(list(self.leave_one_payload_out.values())))


def scores(cases: Cases, known: Cases, asked: Cases) -> list[Score]:
    """Every way to predict, the model first."""
    return [_score(name, cases, known, asked) for name in WAYS]


def _score(name: str, cases: Cases, known: Cases, asked: Cases) -> Score:
    calibrated = WAYS[name](known)
    left_out = {
        payload: mean_error(WAYS[name](cases.without_payload(payload)), cases.of_payload(payload))
        for payload in cases.payloads
    }
    return Score(name, mean_error(calibrated, known), mean_error(calibrated, asked), left_out)


def mean_error(calibrated: Calibrated, asked: Cases) -> float:
    """Mean absolute error [percentage points]."""
    return float(np.abs(calibrated(asked) - asked.printed).mean())


@dataclass(frozen=True)
class Group:
    """How a prediction does on one payload and axis."""

    payload_kg: float
    axis: str
    count: int
    mean_absolute: float
    """[percentage points]"""
    mean: float
    """Predicted - printed [percentage points]."""
    fails: bool
    """Whether the mean exceeds the scatter that the calibration left: a wrong law, not scatter."""


def groups(asked: Cases, predicted: Floats, scatter: float) -> Sequence[Group]:
    """Errors by payload and axis, the worst first."""
    found = []
    for payload in asked.payloads:
        for axis in AXES:
            at = (asked.payload_kg == payload) & (asked.axis == axis)
            errors = (predicted - asked.printed)[at]
            mean = float(errors.mean())
            found.append(Group(payload, axis, len(errors), float(np.abs(errors).mean()), mean, abs(mean) > scatter))
    return sorted(found, key=lambda group: -group.mean_absolute)
