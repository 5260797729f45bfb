"""By how many per cent the vibration of the base fell, with intervals where there are repeats."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import AnalysisError
from .findings import Finding
from .pairing import Key, Pair, doubts, pairs, rig_of
from .vibration import Measure, base_accelerations

if TYPE_CHECKING:
    from .store import Run

CONFIDENCE = 0.95
"""Of the intervals."""


@dataclass(frozen=True)
class Reduction:
    """By how many per cent an amplitude is smaller with counter-masses than without."""

    key: Key
    counter_masses: dict[str, float]
    """By site [kg]."""
    sensor: str
    axis: str
    measure: Measure
    percent: float | None
    """None where nothing vibrated without counter-masses."""
    interval: tuple[float, float] | None
    """Of 95 % confidence, from repeats; None without repeats on both sides."""
    runs: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """The reduction as it is printed."""
        return {
            "payload_kg": self.key.payload_kg,
            "motion": self.key.motion,
            "peak_acceleration_g": self.key.peak_acceleration_g,
            "axis": self.axis,
            "metric": self.measure.metric,
            "band_hz": self.measure.band_hz,
            "reduction_percent": self.percent,
            "interval_percent": list(self.interval) if self.interval else None,
            "origin": self.key.origin,
            "runs": list(self.runs),
            "sensor": self.sensor,
            "counter_masses_kg": self.counter_masses,
        }


@dataclass(frozen=True)
class Analysis:
    """All reductions of a campaign, and what could not be analysed or is doubtful."""

    pairs: tuple[Pair, ...]
    reductions: tuple[Reduction, ...]
    findings: tuple[Finding, ...]

    @property
    def origins(self) -> dict[str, int]:
        """How many runs of each origin the reductions rest on."""
        runs = {run.name: str(run.origin) for pair in self.pairs for run in pair.runs}
        return dict(Counter(runs.values()))


def analyze(runs: Iterable["Run"], measure: Measure) -> Analysis:
    """Take every reduction of a campaign. Raises AnalysisError, saying what each run lacks, if there is none."""
    found, findings = pairs(runs)
    if not found:
        raise AnalysisError("no two runs can be compared:\n" + "\n".join(f"  {f.message}" for f in findings))
    reductions = [reduction for pair in found for reduction in reduce(pair, measure)]
    findings += [doubt for pair in found for run in pair.runs for doubt in doubts(run)]
    return Analysis(tuple(found), tuple(reductions), tuple(dict.fromkeys(findings)))


def reduce(pair: Pair, measure: Measure) -> list[Reduction]:
    """The reductions of one pair, for each axis of each accelerometer on the base."""
    balanced, unbalanced = ([amplitudes(run, measure) for run in some] for some in (pair.balanced, pair.unbalanced))
    places = balanced[0].keys()
    for run, found in zip(pair.runs, [*balanced, *unbalanced], strict=True):
        if found.keys() != places:
            raise AnalysisError(f"{run.name}: its rig has other accelerometers on the base than {pair.runs[0].name}")
    names = tuple(run.name for run in pair.runs)
    return [
        Reduction(
            pair.key,
            pair.counter_masses,
            *place,
            measure,
            percent([a[place] for a in balanced], [a[place] for a in unbalanced]),
            interval([a[place] for a in balanced], [a[place] for a in unbalanced]),
            names,
        )
        for place in places
    ]


def amplitudes(run: "Run", measure: Measure) -> dict[tuple[str, str], float]:
    """Amplitude of the base's vibration by (sensor, axis) [m/s2]."""
    signals = base_accelerations(run, rig_of(run))
    return {place: measure.of(values, rate) for place, (values, rate) in signals.items()}


def percent(balanced: Sequence[float], unbalanced: Sequence[float]) -> float | None:
    """Reduction of amplitudes [%]; of their geometric means where there are repeats. None of nothing."""
    if min(unbalanced) <= 0.0:
        return None
    if min(balanced) <= 0.0:
        return 100.0
    return 100.0 * (1.0 - float(np.exp(np.mean(np.log(balanced)) - np.mean(np.log(unbalanced)))))


def interval(balanced: Sequence[float], unbalanced: Sequence[float]) -> tuple[float, float] | None:
    """Interval of 95 % confidence of the reduction [%]: Welch's t, on the logarithms of repeated amplitudes.

    None with fewer than two repeats on either side, or where an amplitude is zero.
    """
    if min(len(balanced), len(unbalanced)) < 2 or min(*balanced, *unbalanced) <= 0.0:
        return None
    from scipy.stats import t

    logs = [np.log(balanced), np.log(unbalanced)]
    shares = [float(np.var(values, ddof=1)) / len(values) for values in logs]
    middle, spread = float(logs[0].mean() - logs[1].mean()), sum(shares)
    if spread == 0.0:
        half = 0.0
    else:
        freedom = spread**2 / sum(s**2 / (len(values) - 1) for s, values in zip(shares, logs, strict=True))
        half = float(t.ppf(0.5 + CONFIDENCE / 2.0, freedom)) * spread**0.5
    return 100.0 * (1.0 - float(np.exp(middle + half))), 100.0 * (1.0 - float(np.exp(middle - half)))
