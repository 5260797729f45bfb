"""Reductions by three sources compared: analysed from logs, simulated without noise, published.

The simulation knows the rig and the conditions stored with a run, and nothing that was recorded.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np

from balance import datasets
from balance.arrays import Floats
from balance.errors import CounterpoiseError
from balance.mechanism.mechanism import Mechanism
from balance.mechanism.mjcf_parser import load_mechanism
from balance.motion.motion_files import motion_from_texts
from balance.results import INLINE, Key, Shown
from balance.task_pool import HERE, TaskPool

from ..errors import AnalysisError
from ..kinematics.encoder_motion import mechanism_of
from ..published_tables import CONDITIONS, Published
from ..recording import Finding
from ..runs.si_run import SIRun
from ..simulator.loggers import sample_instants
from ..simulator.run import BenchRun, simulate_run
from ..simulator.sensors import base_acceleration
from .metrics import Measure
from .reduction import Reduction, analyze, reduction_percent
from .run_amplitudes import AmplitudesOfRun
from .run_pairs import Pair

if TYPE_CHECKING:
    from ..cross_examination import Examination
    from ..rig import Rig
    from ..store import Run

Bench = Literal["stated", "assumed"]
NOTHING = 1e-9
"""Amplitude below which a computed signal counts as zero [m/s2, N]."""


@dataclass
class Prediction:
    """Simulated reductions of a rig and a mechanism; each condition is simulated once."""

    rig: "Rig"
    mechanism: Mechanism
    measure: Measure
    _simulated: dict[object, tuple[dict[tuple[str, str], float], dict[str, float]]] = field(default_factory=dict)

    def reductions(self, pair: "Pair") -> tuple[dict[tuple[str, str], float | None], dict[str, float | None]]:
        """Reductions [%] of the base's vibration by (sensor, axis), and of the shaking force by axis."""
        with_masses, without = (self._amplitudes(pair, masses) for masses in (pair.counter_masses, {}))
        base = {place: reduction_percent([with_masses[0][place]], [without[0][place]]) for place in without[0]}
        force = {axis: reduction_percent([with_masses[1][axis]], [without[1][axis]]) for axis in without[1]}
        return base, force

    def _amplitudes(
        self, pair: "Pair", masses: dict[str, float]
    ) -> tuple[dict[tuple[str, str], float], dict[str, float]]:
        key = (pair.key, tuple(masses.items()))
        if key not in self._simulated:
            stored = pair.runs[0].inputs.get("motion")
            if stored is None and pair.key.motion not in datasets.dataset_names("motions", ".toml"):
                raise AnalysisError(
                    f"motion {pair.key.motion!r} is neither stored with {pair.runs[0].name} nor shipped, so it cannot "
                    f"be simulated: put {pair.key.motion}.toml into the folder of the run table and ingest into a new "
                    "campaign"
                )
            run = simulate_run(
                self.rig,
                self.mechanism,
                pair.key.planned(pair.runs[0].name, masses),
                motion=None if stored is None else motion_from_texts(*stored),
            )
            self._simulated[key] = self._base(run), self._force(run)
        return self._simulated[key]

    def _base(self, run: BenchRun) -> dict[tuple[str, str], float]:
        found: dict[tuple[str, str], float] = {}
        for name, sensor in self.rig.base_accelerometers.items():
            logger = self.rig.loggers[sensor.logger]
            true = sample_instants(logger, float(run.time[-1]))[1]
            for axis, signal in base_acceleration(sensor, run).items():
                if axis in sensor.channels:
                    found[name, axis] = self._amplitude(np.interp(true, run.time, signal), logger.rate)
        return found

    def _force(self, run: BenchRun) -> dict[str, float]:
        rate = 1.0 / float(run.time[1])
        return {axis: self._amplitude(force, rate) for axis, force in zip("xyz", run.response.force.T, strict=True)}

    def _amplitude(self, signal: Floats, rate_hz: float) -> float:
        """The amplitude; zero for rounding errors of a signal that is zero by symmetry."""
        return self.measure.amplitude(signal, rate_hz) if np.abs(signal).max() > NOTHING else 0.0


def _percent(label: str, name: str = "") -> Key:
    return Key(f"{name or label}_percent", f"{label} %", ".1f")


@dataclass(frozen=True)
class Row:
    """One reduction by three sources [%]; None where there is none."""

    analyzed: Annotated[Reduction, INLINE]
    simulated: Annotated[float | None, _percent("simulated")]
    published: Annotated[float | None, _percent("published")]
    shaking_force: Annotated[float | None, _percent("simulated shaking force", "simulated_shaking_force")]
    bench: Annotated[Bench | None, Key("", "bench simulated")] = None
    """Whether the rig of the runs states the bench that was simulated; None where none was."""

    @property
    def percent(self) -> Annotated[float | None, Key("analyzed_percent")]:
        """By the logs."""
        return self.analyzed.percent

    @property
    def text(self) -> Annotated[str, Key(None, "analysed % [95 %]")]:
        """By the logs, with the interval."""
        return self.analyzed.text


@dataclass(frozen=True)
class Comparison(Shown, rows="rows", figure="testbench.figures.reductions:reductions"):
    """All rows of a campaign, and findings about what could not be compared or is doubtful.

    >>> import testbench
    >>> [row.analyzed.axis for row in testbench.compare("campaign").rows]
    ['x', 'y', 'z']
    """

    rows: Annotated[tuple[Row, ...], Key()]
    origins: Annotated[dict[str, int], Key("runs_by_origin")]
    """Number of runs by origin."""
    findings: Annotated[tuple[Finding, ...], Key()]
    published: Annotated[Published | None, Key()]
    measure: Measure
    examination: "Examination | None" = field(default=None, repr=False, compare=False)
    """What the campaign's sensors and runs state of each other."""
    clocks: tuple[str, ...] = ()
    """As of an analysis."""

    @property
    def definition(self) -> Annotated[str, Key()]:
        """What an amplitude is."""
        return str(self.measure)

    @property
    def notes(self) -> Annotated[list[str], Key()]:
        """Notes for who reads the rows."""
        return [
            *self.clocks,
            *(self.published.notes if self.published else ()),
            *self._unmatched_note(),
            *published_difference_note(self.rows),
            *outside_interval_note(self.rows),
        ]

    def _unmatched_note(self) -> list[str]:
        """Of the published conditions those that no run has."""
        if self.published is None:
            return []
        met = {self.published.condition(*_stated(row.analyzed)) for row in self.rows}
        left = [row for row in self.published.rows if row not in met]
        listed = "; ".join(
            ", ".join(f"{name} {value}" for name, value in zip(CONDITIONS, row, strict=True) if value is not None)
            for row in left[:3]
        )
        more = f"; and {len(left) - 3} more" if len(left) > 3 else ""
        return [f"Published, and of no run with that condition in the run table: {listed}{more}."] if left else []


def published_difference_note(rows: Sequence[Row]) -> list[str]:
    """Ranges of simulated and published reductions, and what the simulation omits; none without both."""
    both = [row for row in rows if row.simulated is not None and row.published is not None]
    if not both:
        return []
    motions = dict.fromkeys(row.analyzed.key.motion for row in both)
    ranges = [
        _ranges_of_motion(motion, [row for row in both if row.analyzed.key.motion == motion]) for motion in motions
    ]
    return [
        f"Why simulated is not published: {'; '.join(ranges)}. The simulated bench is what its rig describes; much "
        "of that is assumed, and nothing was tuned to the table. Of a real one it has the shaking moment with the "
        "counter-masses' own inertia; compliance of links, frame and drives, and couples of separate planes only as "
        "far as the rig describes them. testbench predict calibrates these on one payload and predicts the others."
    ]


def outside_interval_note(rows: Sequence[Row]) -> list[str]:
    """In how many rows the simulation lies outside the interval of the analysis; none where no row has both."""
    known = [(row.simulated, row.analyzed.interval) for row in rows]
    both = [(value, interval) for value, interval in known if value is not None and interval is not None]
    outside = sum(not _within(*one) for one in both)
    if not both:
        return []
    check = ": the rig or the run table describes another bench, or the logs begin too late to show their noise"
    return [
        f"Simulated lies outside the interval of the analysis in {outside} of {len(both)} rows"
        f"{check if 2 * outside > len(both) else ''}."
    ]


def _within(value: float, interval: tuple[float, float]) -> bool:
    return interval[0] <= value <= interval[1]


def _ranges_of_motion(motion: str, rows: Sequence[Row]) -> str:
    """Smallest and largest reduction of each kind in the rows of a motion."""
    kinds = {
        "the simulated base": [row.simulated for row in rows],
        "the published base": [row.published for row in rows],
        "the simulated shaking force": [row.shaking_force for row in rows],
    }
    known = {name: [value for value in values if value is not None] for name, values in kinds.items()}
    falls = [f"{name} is reduced by {_range_text(values)} %" for name, values in known.items() if values]
    return f"in motion {motion} {', '.join(falls)}"


def _range_text(values: Sequence[float]) -> str:
    """``53.2 .. 89.5``, or ``99.9`` where both ends round to the same."""
    least, most = (f"{value:.1f}" for value in (min(values), max(values)))
    return least if least == most else f"{least} .. {most}"


def compare_campaign(
    runs: Iterable["Run"],
    published: Published | None,
    measure: Measure,
    mechanism: str | None = None,
    accept: Iterable[str] = (),
    examination: "Examination | None" = None,
    known: Mapping[int, AmplitudesOfRun | str] | None = None,
    pool: TaskPool = HERE,
) -> Comparison:
    """Compare every reduction of a campaign with its simulation, and with ``published`` where it is given.

    ``accept``, ``examination``, ``known``, ``pool``: see :func:`analyze`.
    """
    given = load_mechanism(mechanism) if mechanism else None
    analysis = analyze(runs, measure, accept, given, pool, examination, known)
    findings = list(analysis.findings)
    predictions: dict[object, Prediction] = {}
    rows: list[Row] = []
    for pair in analysis.pairs:
        simulated, force = _simulated(pair, predictions, measure, mechanism, findings)
        described = "bench" in SIRun.of(pair.runs[0]).rig.model_fields_set
        for r in analysis.reductions:
            if r.key == pair.key and r.counter_masses == pair.counter_masses:
                value = simulated.get((r.sensor, r.axis))
                bench: Bench | None = None if value is None else "stated" if described else "assumed"
                rows.append(Row(r, value, _published(published, r), force.get(r.axis), bench))
    if any(row.bench == "assumed" for row in rows):
        findings.append(
            Finding(
                "bench_assumed", None, None, "the rig stored with the runs has no [bench]: an assumed one was "
                "simulated; describe its mass and mounts in the rig's file, and ingest into another folder with it",
            )
        )  # fmt: skip
    told, examination = tuple(dict.fromkeys(findings)), analysis.examination
    return Comparison(tuple(rows), analysis.origins, told, published, measure, examination, analysis.clocks)


def _simulated(
    pair: Pair,
    predictions: dict[object, Prediction],
    measure: Measure,
    mechanism: str | None,
    findings: list[Finding],
) -> tuple[dict[tuple[str, str], float | None], dict[str, float | None]]:
    """The simulated reductions of a pair; none, and a finding, where the bench cannot be simulated."""
    run = SIRun.of(pair.runs[0])
    rig, key = run.rig, (run.rig.text, pair.runs[0].inputs.get("mechanism"))
    try:
        if key not in predictions:
            predictions[key] = Prediction(rig, mechanism_of(run, mechanism), measure)
        return predictions[key].reductions(pair)
    except CounterpoiseError as error:
        findings.append(Finding("not_simulated", None, None, str(error)))
        return {}, {}


def _published(published: Published | None, reduction: Reduction) -> float | None:
    printed = None if published is None else published.condition(*_stated(reduction))
    return None if published is None or printed is None else published.rows[printed].get(reduction.axis)


def _stated(reduction: Reduction) -> tuple[object, ...]:
    """The condition of a reduction, as CONDITIONS; with payloads of several bodies it is none of a table."""
    key = reduction.key
    return key.payloads or key.payload_kg, key.motion, key.peak_acceleration_g, key.peak_acceleration_rad_s2
