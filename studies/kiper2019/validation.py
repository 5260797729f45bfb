"""Calibrate on the lightest payload, predict all others, and say how good that is.

How far predictions are off: on what was calibrated on, on what was held out, and each payload left out in turn; beside
baselines without mechanics, which a model must pass to be worth anything. And which terms the law needs, asked of the
calibrated table alone.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from balance.arrays import Floats
from testbench.campaign_plan import Plan
from testbench.published_tables import ORIGINAL_LOGS, Published

from .calibration import LEVEL, Fit, Posterior, fit, marginalise
from .force_slide import Reading, reading
from .model import AXES, DISCREPANCY, NAMES, PARAMETERS, SCATTER, Cases, cases


def constant(known: Cases, asked: Cases) -> Floats:
    """The mean of all known reductions [%], (n,)."""
    return np.full(len(asked.printed), known.printed.mean())


def per_axis(known: Cases, asked: Cases) -> Floats:
    """The mean of the known reductions of the same axis [%], (n,)."""
    return np.array([known.printed[known.axis == axis].mean() for axis in asked.axis])


def nearest_acceleration(known: Cases, asked: Cases) -> Floats:
    """The known reduction of the same motion and axis at the nearest peak acceleration, by ratio [%], (n,).

    The mean of those that are equally near.
    """
    return np.array([
        _nearest(known.where((known.motion == motion) & (known.axis == axis)), acceleration)
        for motion, axis, acceleration in zip(asked.motion, asked.axis, asked.peak_acceleration, strict=True)
    ])  # fmt: skip


def _nearest(alike: Cases, acceleration: float) -> float:
    apart = np.abs(np.log(alike.peak_acceleration / acceleration))
    return float(alike.printed[np.isclose(apart, apart.min())].mean())


BASELINES: dict[str, Callable[[Cases, Cases], Floats]] = {
    "constant": constant,
    "per axis": per_axis,
    "nearest acceleration": nearest_acceleration,
}

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


@dataclass(frozen=True)
class Forecast:
    """Printed numbers predicted from those of one payload."""

    published: Published
    known: Cases
    """Calibrated on."""
    asked: Cases
    """Predicted."""
    best: Fit
    posterior: Posterior
    predicted: Floats
    """Of the asked, (n,) [%]."""
    interval: Floats
    """95 % for a printed number, (n, 2) [%]."""
    scores: Sequence[Score]
    """The model's first, then baselines."""
    reading: Reading | None

    @property
    def errors(self) -> Floats:
        """Predicted - printed, (n,) [percentage points]."""
        return self.predicted - self.asked.printed

    @property
    def covered(self) -> float:
        """Share of the asked numbers within their intervals."""
        low, high = self.interval.T
        return float(np.mean((low <= self.asked.printed) & (self.asked.printed <= high)))

    @property
    def groups(self) -> Sequence[Group]:
        """Errors by payload and axis, the worst first."""
        return groups(self.asked, self.predicted, self.posterior.interval(SCATTER.name)[0])

    @property
    def residual_share(self) -> tuple[float, float, float]:
        """Median and 95 % interval of the residual's share of the squares that it and the couples leave."""
        samples, taken = self.posterior.samples, float(self.known.mechanics[:, 2].mean())
        couples = np.mean([samples[p.name] ** 2 for p in PARAMETERS if p.name.startswith("couple_share")], axis=0)
        share = samples["residual_mass"] ** 2 / (samples["residual_mass"] ** 2 + couples * taken**2)
        low, high = (1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0
        middle, low, high = np.quantile(share, [0.5, low, high])
        return float(middle), float(low), float(high)

    @property
    def notes(self) -> list[str]:
        """What a reader of the numbers must know."""
        return [note for note in (self._calibrated(), self._fails(), self._scatter(), *self._slide()) if note]

    def _calibrated(self) -> str:
        middle, low, high = self.residual_share
        return (
            f"{len(PARAMETERS) + 2} parameters (scatter and the law's own error are two) were calibrated on "
            f"{len(self.known.printed)} numbers of {self.known.payloads[0]:g} kg alone. These leave open of what "
            f"remains the residual's share (the rest is couples): {middle:.0%}, {low:.0%} to {high:.0%}; the "
            "prediction is the median over all of that. The predicted numbers are in print and were known: "
            "studies/kiper2019/README.md has every choice that was made after seeing them."
        )

    def _fails(self) -> str:
        failing = [f"{g.payload_kg:g} kg along {g.axis} ({g.mean:+.1f} points)" for g in self.groups if g.fails]
        scatter = self.posterior.interval(SCATTER.name)[0]
        if not failing:
            return f"No payload and axis is off by more than the scatter of {scatter:.1f} points on average."
        return f"It fails, off on average by more than the scatter of {scatter:.1f} points, at {', '.join(failing)}."

    def _scatter(self) -> str:
        middle, low, high = self.posterior.interval(DISCREPANCY.name)
        held, count = round(self.covered * len(self.asked.printed)), len(self.asked.printed)
        return (
            f"Of the predicted numbers {held} of {count} lie within their intervals of {LEVEL:.0%}. These hold the "
            "scatter, what is left open within this law, and the law's own error: an offset that the numbers of one "
            f"payload, motion and axis share, by the calibrated numbers alone of {middle:.1f} points (standard "
            f"deviation, {low:.1f} to {high:.1f}). They leave it open, so its bound, {DISCREPANCY.high:g} points, has "
            "a part in the width: half of it would make the intervals a tenth narrower."
        )

    def _slide(self) -> list[str]:
        if self.published.force_extremes is None:
            return []
        said = [self.published.force_extremes.contradiction()]
        if self.reading:
            said += [f"What cannot reconcile them: {'; '.join(self.reading.cannot())}."]
            said += [f"What could, none of it decidable from print: {'; '.join(self.reading.can())}."]
        return [*said, ORIGINAL_LOGS]


def forecast(published: Published, plan: Plan) -> Forecast:
    """Predict a table. Raises AnalysisError where the plan lacks its conditions or the calibration fails."""
    found = cases(published, plan)
    lightest = found.payloads[0]
    known, asked = found.of_payload(lightest), found.without_payload(lightest)
    posterior = marginalise(known)
    predicted, interval = posterior.predict(asked)
    beside = reading(published.force_extremes, found) if published.force_extremes else None
    return Forecast(
        published, known, asked, fit(known), posterior, predicted, interval, scores(found, known, asked), beside
    )
