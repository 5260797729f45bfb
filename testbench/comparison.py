"""Analysed from logs, simulated anew and published, side by side."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from balance.errors import CounterpoiseError

from .findings import Finding
from .pairing import Pair, rig_of
from .prediction import Prediction
from .published import ORIGINAL_LOGS, Published
from .reductions import Reduction, analyze
from .vibration import Measure

if TYPE_CHECKING:
    from .store import Run

WHY = (
    "Why the simulation is not the published table: these counter-masses balance the force and nothing else. In the "
    "simulation the shaking force falls as the last column says, and the base follows it wherever force alone moves "
    "it. The shaking moment stays; the counter-masses' own inertia even raises it, and in the x motion, where both "
    "arms turn the same way, it rocks the base. A real bench has more that balancing does not remove: flexible "
    "links, frame and mounts, play and drives, a plane offset between arms and counter-masses, payloads that are not "
    "quite the assumed ones. None of it is in this bench, whose base, mounts and positions are assumed; nothing was "
    "tuned to the table. Analysed lies below simulated where what is left sinks into the accelerometer's noise."
)


@dataclass(frozen=True)
class Row:
    """One reduction in three ways [%]; None where there is none."""

    analyzed: Reduction
    simulated: float | None
    published: float | None
    shaking_force: float | None

    def as_dict(self) -> dict[str, Any]:
        """The row as it is printed."""
        row = self.analyzed.as_dict()
        return {
            **{
                name: row[name] for name in ("payload_kg", "motion", "peak_acceleration_g", "axis", "metric", "band_hz")
            },
            "analyzed_percent": self.analyzed.percent,
            "simulated_percent": self.simulated,
            "published_percent": self.published,
            "simulated_shaking_force_percent": self.shaking_force,
            **{name: row[name] for name in ("origin", "runs", "sensor", "counter_masses_kg")},
        }


@dataclass(frozen=True)
class Comparison:
    """All rows of a campaign, and what could not be compared or is doubtful."""

    rows: tuple[Row, ...]
    origins: dict[str, int]
    """How many runs of each origin the rows rest on."""
    findings: tuple[Finding, ...]
    published: str = ""
    """Name of the published table."""

    @property
    def notes(self) -> list[str]:
        """What a reader of the rows must know."""
        both = any(row.published is not None and row.simulated is not None for row in self.rows)
        if self.published != "kiper2019":
            return []
        return [ORIGINAL_LOGS, WHY] if both and set(self.origins) == {"simulated"} else [ORIGINAL_LOGS]


def compare(runs: Iterable["Run"], published: Published, measure: Measure, mechanism: str | None = None) -> Comparison:
    """Compare every reduction of a campaign with its simulation and with print.

    The simulation knows the rig and conditions stored with the runs, and nothing that was recorded.
    """
    analysis = analyze(runs, measure)
    findings = list(analysis.findings)
    predictions: dict[str, Prediction] = {}
    rows: list[Row] = []
    for pair in analysis.pairs:
        simulated, force = _simulated(pair, predictions, measure, mechanism, findings)
        rows += [
            Row(r, simulated.get((r.sensor, r.axis)), _printed(published, r), force.get(r.axis))
            for r in analysis.reductions
            if r.key == pair.key and r.counter_masses == pair.counter_masses
        ]
    return Comparison(tuple(rows), analysis.origins, tuple(dict.fromkeys(findings)), published.name)


def _simulated(
    pair: Pair,
    predictions: dict[str, Prediction],
    measure: Measure,
    mechanism: str | None,
    findings: list[Finding],
) -> tuple[dict[tuple[str, str], float | None], dict[str, float | None]]:
    """The simulated reductions of a pair; where the bench cannot be simulated, none and a finding."""
    rig = rig_of(pair.runs[0])
    try:
        if rig.text not in predictions:
            predictions[rig.text] = Prediction.of(rig, measure, mechanism)
        if "bench" not in rig.model_fields_set:
            findings.append(
                Finding("bench_assumed", None, None, "the rig has no [bench]: an assumed one was simulated")
            )
        return predictions[rig.text].reductions(pair)
    except CounterpoiseError as error:
        findings.append(Finding("not_simulated", None, None, str(error)))
        return {}, {}


def _printed(published: Published, reduction: Reduction) -> float | None:
    key = reduction.key
    return published.reduction(key.payload_kg, key.motion, key.peak_acceleration_g, reduction.axis)
