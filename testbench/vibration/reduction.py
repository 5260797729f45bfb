"""By how many per cent the vibration of the base fell, with intervals: from repeats, or from the noise at rest."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..errors import AnalysisError
from ..published_tables import MANIPULATOR, NO_ORIGINALS
from ..recording import Finding
from ..runs.si_run import SIRun
from . import ConditionAmplitude, Ratio
from .amplitude import Place
from .condition import Condition, Scatter, scatter_of
from .feldman_cousins import CONFIDENCE
from .metrics import Measure
from .run_pairs import ConditionKey, Pair, pairs

if TYPE_CHECKING:
    from ..store import Run

__all__ = ["CONFIDENCE", "Analysis", "Reduction", "analyze", "percent", "reduction_of_pair"]
Method = Literal["repeats", "propagation"]
"""Where an interval comes from: the scatter of the campaign's repeats, or noise at rest, propagated."""
Limit = Literal["at_least", "at_most"]


@dataclass(frozen=True)
class Reduction:
    """By how many per cent an amplitude is smaller with counter-masses than without."""

    key: ConditionKey
    counter_masses: dict[str, float]
    """By site [kg]."""
    sensor: str
    axis: str
    measure: Measure
    percent: float | None
    """Of what is left when noise is taken off; None where nothing vibrated above it without counter-masses."""
    interval: tuple[float, float] | None
    """Of 95 % confidence; None where there is none."""
    method: Method | None
    """Where the interval comes from."""
    limit: Limit | None
    """``at_least``: what is left is below the noise, or the sensor clipped without counter-masses."""
    below_noise: bool
    """Whether what is left with counter-masses is not above the noise."""
    amplitudes: tuple[float, float]
    """With and without counter-masses, noise taken off [m/s2]."""
    noise_floor: tuple[float | None, float | None]
    """What the metric shows of noise alone, with and without counter-masses [m/s2]; None where nothing tells it."""
    noise_stated: bool
    """Whether the noise is what the rig states, since no rest of any of the runs shows it."""
    resolution: float
    """Step of the channel [m/s2]; zero where none is known."""
    n: tuple[int, int]
    """How many runs with and without counter-masses."""
    runs: tuple[str, ...]

    @property
    def at_least(self) -> float | None:
        """The reduction that is surely reached [%], where it is a lower bound."""
        return self.interval[0] if self.limit == "at_least" and self.interval else None

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
            "confidence_percent": 100.0 * CONFIDENCE,
            "method": self.method,
            "limit": self.limit,
            "at_least_percent": self.at_least,
            "below_noise": self.below_noise,
            "amplitude_m_s2": _both(self.amplitudes),
            "noise_floor_m_s2": _both(self.noise_floor),
            "noise_stated": self.noise_stated,
            "resolution_m_s2": self.resolution,
            "n": _both(self.n),
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

    @property
    def notes(self) -> list[str]:
        """What a reader of the reductions must know."""
        simulated = [run for pair in self.pairs for run in pair.runs if run.origin == "simulated"]
        shown = any(SIRun.of(run).rig.mechanism.startswith(MANIPULATOR) for run in simulated)
        return [NO_ORIGINALS] if shown else []


def analyze(runs: Iterable["Run"], measure: Measure) -> Analysis:
    """Take every reduction of a campaign. Raises AnalysisError, saying what each run lacks, if there is none."""
    found, findings = pairs(runs)
    if not found:
        raise AnalysisError("no two runs can be compared:\n" + "\n".join(f"  {f.message}" for f in findings))
    conditions = _conditions(found, measure, findings)
    scatter, reductions = scatter_of(conditions), []
    for condition in conditions:
        some = _reductions(condition, scatter)
        findings += [*condition.findings, *reduction_findings(condition, some)]
        findings += [*scatter_findings(condition, scatter), *condition.doubts]
        reductions += some
    return Analysis(
        tuple(condition.pair for condition in conditions), tuple(reductions), tuple(dict.fromkeys(findings))
    )


def _conditions(found: Sequence[Pair], measure: Measure, findings: list[Finding]) -> list[Condition]:
    """Every pair, judged; of those that cannot be, a finding. Raises AnalysisError if none can."""
    conditions, lacks = [], []
    for pair in found:
        try:
            conditions.append(Condition.of(pair, measure))
        except AnalysisError as error:
            where = " ".join(run.name for run in pair.runs)
            lacks.append(Finding("not_analyzed", None, where, f"{pair.key}: {error}"))
    if not conditions:
        raise AnalysisError("\n".join(lack.message for lack in lacks))
    findings += lacks
    return conditions


def reduction_of_pair(pair: Pair, measure: Measure) -> list[Reduction]:
    """The reductions of one pair by itself, for each axis of each accelerometer on the base."""
    condition = Condition.of(pair, measure)
    return _reductions(condition, scatter_of([condition]))


def _reductions(condition: Condition, scatter: Scatter) -> list[Reduction]:
    return [
        _reduction(condition, place, scatter) if condition.judgeable(place) else _bare(condition, place)
        for place in condition.groups
    ]


def _reduction(condition: Condition, place: Place, scatter: Scatter) -> Reduction:
    pair, sides = condition.pair, condition.sides(place, scatter)
    ratio = Ratio(*sides)
    interval = None if ratio.interval is None else (_fall(ratio.interval[1]), _fall(ratio.interval[0]))
    scattered = any(side.own or side.repeats for side in sides)
    return Reduction(
        pair.key,
        pair.counter_masses,
        *place,
        condition.measure,
        None if ratio.value is None or interval is None else _fall(ratio.value),
        _bounded(interval, sides),
        None if interval is None else "repeats" if scattered else "propagation",
        _limit(sides, ratio.defined and ratio.below_noise),
        ratio.defined and ratio.below_noise,
        (sides[0].amplitude, sides[1].amplitude),
        (sides[0].floor, sides[1].floor),
        condition.noise_stated[place],
        condition.resolution[place],
        (len(pair.balanced), len(pair.unbalanced)),
        tuple(run.name for run in pair.runs),
    )


def _bare(condition: Condition, place: Place) -> Reduction:
    """Of what was read, noise included: neither repeats nor a rest stretch say how sure it is."""
    pair, groups = condition.pair, condition.groups[place]
    sides = ConditionAmplitude(groups[0]), ConditionAmplitude(groups[1])
    read = [[run.statistic.amplitude(run.reading) for run in group.runs] for group in groups]
    means = float(np.mean(read[0])), float(np.mean(read[1]))
    floors = (None, None)
    count = len(read[0]), len(read[1])
    names = tuple(run.name for run in pair.runs)
    fell = None if condition.dead.get(place) else percent(read[0], read[1])
    return Reduction(
        pair.key, pair.counter_masses, *place, condition.measure, fell, None, None,
        _limit(sides, False), False, means, floors, False, 0.0, count, names,
    )  # fmt: skip


def _bounded(
    interval: tuple[float, float] | None, sides: tuple[ConditionAmplitude, ConditionAmplitude]
) -> tuple[float, float] | None:
    """A sensor that clipped without counter-masses leaves the upper end open; one that clipped with them, the lower."""
    if interval is None or sides[0].bound:
        return None
    return (interval[0], 100.0) if sides[1].bound else interval


def _limit(sides: tuple[ConditionAmplitude, ConditionAmplitude], below_noise: bool) -> Limit | None:
    if sides[0].bound:
        return None if sides[1].bound else "at_most"
    return "at_least" if sides[1].bound or below_noise else None


def _fall(ratio: float) -> float:
    return 100.0 * (1.0 - ratio)


def _both(values: tuple[Any, Any]) -> dict[str, Any]:
    return {"with": values[0], "without": values[1]}


def percent(balanced: Sequence[float], unbalanced: Sequence[float]) -> float | None:
    """Reduction of amplitudes without noise [%]; of their geometric means where there are several. None of nothing."""
    if min(unbalanced) <= 0.0:
        return None
    if min(balanced) <= 0.0:
        return 100.0
    return _fall(float(np.exp(np.mean(np.log(balanced)) - np.mean(np.log(unbalanced)))))


def reduction_findings(condition: Condition, found: Sequence[Reduction]) -> list[Finding]:
    """What the reductions of a pair cannot say, a finding each."""
    pair, dead = condition.pair, {place for place, runs in condition.dead.items() if runs}
    where = " ".join(run.name for run in pair.runs)
    alive = [r for r in found if (r.sensor, r.axis) not in dead]
    kinds = {
        "dead_channel": (
            [r for r in found if (r.sensor, r.axis) in dead],
            "the channel shows one value only in a run: there is no reduction",
        ),
        "vibrates_more": (
            [r for r in alive if r.interval and r.interval[1] < 0.0],
            "it vibrates more with counter-masses than without: if that is not so, runs or sheet are mixed up",
        ),
        "below_noise": (
            [r for r in found if r.below_noise],
            "what is left with counter-masses is not above the noise: the reductions are lower bounds",
        ),
        "no_reduction": (
            [r for r in alive if r.percent is None],
            "nothing vibrates above the noise without counter-masses: there is no reduction",
        ),
        "noise_stated": (
            [r for r in found if r.noise_stated],
            "no stretch at rest before the motion shows the noise: that which the rig states is taken off",
        ),
        "no_noise_floor": (
            [r for r in alive if None in r.noise_floor],
            "no stretch at rest before the motion is long enough to show the noise, and the rig states none: it is in "
            "the amplitudes, so that what falls may be noise",
        ),
    }
    return [
        Finding(code, None, where, f"{pair.key}, {sensor} along {', '.join(axes)}: {says} ({where})")
        for code, (some, says) in kinds.items()
        for sensor in dict.fromkeys(r.sensor for r in some)
        if (axes := [r.axis for r in some if r.sensor == sensor])
    ]


def scatter_findings(condition: Condition, scatter: Scatter) -> list[Finding]:
    """Repeats of a condition that scatter more than those of the others let expect."""
    odd = [
        (place, group)
        for place, groups in condition.groups.items()
        for group in groups
        if (repeats := scatter[place]) and repeats.leaves_out(group)
    ]
    return [
        Finding(
            "repeats_differ",
            None,
            where := " ".join(group.names),
            f"{condition.pair.key}, {sensor} along {axis}: repeats differ more than those of other conditions let "
            f"expect: the interval comes from them alone ({where})",
        )
        for (sensor, axis), group in odd
    ]
