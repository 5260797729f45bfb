"""The clocks of all loggers of a stored run, aligned with one of them.

Alignments as records of a campaign: what was found for each run, by when, to be used by what comes after.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from balance.errors import CounterpoiseError
from balance.mechanism.mechanism import Mechanism

from ..errors import AnalysisError
from ..kinematics import base_motion
from ..rig.sensors import Encoder
from ..runs.si_run import SIRun
from ..store import append_only_records
from .clock_map import ClockMap, same_clock
from .common_signals import Making, Scene, delay_of, named, signal_pairs
from .offset_and_drift import Aligned, by_correlation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..store import Run
    from .signal_preparation import Shared

AlignmentMethod = Callable[["Shared", bool], Aligned]
"""How two clocks are aligned by what both saw; with a drift, or without one."""


@dataclass(frozen=True)
class RunClocks:
    """How the clocks of a run's groups run on that of ``reference``, and why some are not aligned."""

    run: str
    origin: str
    reference: str
    aligned: Mapping[str, Aligned]
    refused: Mapping[str, str]
    delays: Mapping[str, float | None] = field(default_factory=dict)
    """Of the filter of each group's logger [s], which is taken off; None where the rig states no filter."""

    def map_of(self, group: str) -> ClockMap:
        """The map of a group's clock. Raises AnalysisError, saying why, if there is none."""
        if group == self.reference:
            return same_clock((0.0, 0.0))
        if group not in self.aligned:
            raise AnalysisError(
                f"{self.run}: {group} is not aligned: {self.refused.get(group, 'it was not asked for')}"
            )
        return self.aligned[group].clock

    @property
    def findings(self) -> list[str]:
        """Gaps that were left out, by run and group."""
        return [f"{self.run}: {group}: {text}" for group, one in self.aligned.items() for text in one.findings]

    def as_rows(self) -> list[dict[str, Any]]:
        """The alignments as they are printed and stored."""
        return [
            {
                "run": self.run,
                "origin": self.origin,
                "reference": self.reference,
                "group": group,
                "method": one.method,
                "content": one.content,
                "explained": one.explained,
                "findings": list(one.findings),
                "filter_delay_s": self.delays.get(group),
                "reference_filter_delay_s": self.delays.get(self.reference),
                **one.clock.as_dict(),
            }
            for group, one in self.aligned.items()
        ]


def align_run(
    run: SIRun,
    mechanism: Callable[[], Mechanism],
    reference: str | None = None,
    drift: bool = True,
    cutoff: float | None = None,
    way: AlignmentMethod = by_correlation,
    among: Collection[str] | None = None,
) -> RunClocks:
    """Align all groups, or those ``among``, by what the rig says that both saw; the reference is that of the encoders
    unless named. The base's accelerometers are aligned in any case, for others are with their help.

    Raises AnalysisError if the run has one group only.
    """
    if len(run.groups) < 2:
        raise AnalysisError(f"{run.name}: one logger, one clock: there is nothing to align")
    reference = reference or _reference(run)
    run.group(reference)
    scene = Scene(run, mechanism, cutoff)
    known = {reference: same_clock((0.0, 0.0))}
    aligned: dict[str, Aligned] = {}
    refused: dict[str, str] = {}
    for group in _base_first(run, reference, among):
        found = _first(signal_pairs(scene, reference, group, known), drift, way)
        if isinstance(found, Aligned):
            aligned[group], known[group] = found, found.clock
        else:
            refused[group] = found
    delays = {group.name: delay_of(run, group.name) for group in run.groups}
    return RunClocks(run.name, run.origin, reference, aligned, refused, delays)


def align_named(
    run: "Run", reference: str, own: str, drift: bool, cutoff: float | None, way: AlignmentMethod
) -> RunClocks:
    """Align two groups by a channel of each, which a person names."""
    there, here = (run.find(channel)[0].name for channel in (reference, own))
    if there == here:
        raise AnalysisError(f"{run.name}: {reference!r} and {own!r} are in one group, {here}: they share a clock")
    found = way(named(run, reference, own, cutoff), drift)
    delays = {group: delay_of(SIRun.of(run), group) for group in (there, here)} if run.rig is not None else {}
    return RunClocks(run.name, run.origin, there, {here: found}, {}, delays)


def _reference(run: SIRun) -> str:
    """The group that holds the encoders, else the first."""
    columns = run.rig.columns_of(Encoder)
    return next((g.name for column in columns for g in run.groups if run.holds(column, g.name)), run.groups[0].name)


def _base_first(run: SIRun, reference: str, among: Collection[str] | None) -> list[str]:
    """The other groups, that of the base's accelerometers first: the forces are aligned with their help."""
    base = base_motion.base_acceleration(run)
    first = base.group if base is not None else None
    others = [group.name for group in run.groups if group.name != reference]
    kept = [name for name in others if among is None or name in among or name == first]
    return sorted(kept, key=lambda name: name != first)


def _first(found: Iterable[Making], drift: bool, way: AlignmentMethod) -> Aligned | str:
    """The first candidate that determines the clock, or why none does."""
    reasons: list[str] = []
    for making in found:
        try:
            return _twice(making, drift, way)
        except CounterpoiseError as error:
            reasons.append(str(error))
    return "; ".join(reasons) or (
        "the rig names nothing that both loggers saw; name a channel of each, --pair REFERENCE=OWN, or record a trigger"
    )


def _twice(making: Making, drift: bool, way: AlignmentMethod) -> Aligned:
    """Roughly first; where that gives another content, such as one with the base's motion taken out, again by it."""
    rough_content = making(None)
    if not rough_content.partial:
        return way(rough_content, drift)
    first = way(rough_content, False)
    return way(making(first.clock), drift)


KIND = "alignment"


def write_alignments(campaign: Path, runs: "Sequence[tuple[Path, RunClocks]]") -> Path:
    """Add a record of the alignments of stored runs; returns its file."""
    rows = [row for _, clocks in runs for row in clocks.as_rows()]
    return append_only_records.append_record(campaign, KIND, [path for path, _ in runs], {"alignments": rows})


def stored_clock_maps(run: Path, reference: str) -> dict[str, ClockMap]:
    """The newest stored map of each clock of a run onto that of ``reference``; empty where there is none."""
    found: dict[str, ClockMap] = {}
    for record in append_only_records.about(run.parent, KIND, run):
        for row in record.content.get("alignments", []):
            if row["run"] == run.stem and row["reference"] == reference:
                found[row["group"]] = ClockMap.from_dict(row)
    return found | {reference: same_clock((0.0, 0.0))} if found else {}
