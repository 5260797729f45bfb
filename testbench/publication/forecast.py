"""Calibrate on the lightest payload, predict all others, and say how good that is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from balance.arrays import Floats

from ..plan import Plan
from ..published import ORIGINAL_LOGS, Published
from .calibration import Fit, fit
from .cases import Cases, cases
from .model import PARAMETERS, SCATTER
from .posterior import LEVEL, Posterior, marginalise
from .slide_reading import Reading, reading
from .validation import Group, Score, groups, scores


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
            f"{len(PARAMETERS) + 1} parameters (the scatter is one) were calibrated on {len(self.known.printed)} "
            f"numbers of {self.known.payloads[0]:g} kg alone. These leave open of what remains the residual's share "
            f"(the rest is couples): {middle:.0%}, {low:.0%} to {high:.0%}; the prediction is the median over all "
            "of that. The predicted numbers are in print and were known: docs/prediction.md has every choice that was "
            "made after seeing them."
        )

    def _fails(self) -> str:
        failing = [f"{g.payload_kg:g} kg along {g.axis} ({g.mean:+.1f} points)" for g in self.groups if g.fails]
        scatter = self.posterior.interval(SCATTER.name)[0]
        if not failing:
            return f"No payload and axis is off by more than the scatter of {scatter:.1f} points on average."
        return f"It fails, off on average by more than the scatter of {scatter:.1f} points, at {', '.join(failing)}."

    def _scatter(self) -> str:
        return (
            f"Of the predicted numbers {self.covered:.0%} lie within their intervals of {LEVEL:.0%}: these hold the "
            "scatter and what is left open within this law, and nothing of the law's own errors."
        )

    def _slide(self) -> list[str]:
        if self.published.slide is None:
            return []
        said = [self.published.slide.contradiction()]
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
    beside = reading(published.slide, found) if published.slide else None
    return Forecast(
        published, known, asked, fit(known), posterior, predicted, interval, scores(found, known, asked), beside
    )
