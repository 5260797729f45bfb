"""The clocks of all loggers of a stored run aligned with one of them, and alignments as dated records of a campaign."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from balance.errors import CounterpoiseError
from balance.mechanism.mechanism import Mechanism
from balance.results import INLINE, Key, plain

from ..errors import AnalysisError
from ..kinematics import base_motion
from ..rig.sensors import Encoder
from ..runs.si_run import SIRun
from ..store import Run, append_only_records
from .clock_map import ClockMap, same_clock
from .common_signals import RunMotion, SignalBuilder, SignalPairs, delay_of, named_channels, signal_pairs
from .offset_and_drift import AlignedClock, by_correlation
from .signal_preparation import SharedSignals

AlignmentMethod = Callable[["SharedSignals", bool], AlignedClock]
"""Aligns two clocks by common signals, with a drift or without one."""


_START_TIMES_AGREE_S = 60.0
"""Difference up to which start times may be of one run [s]: calendars of loggers are set by hand."""


@dataclass(frozen=True)
class RunClocks:
    """Maps of the clocks of a run's groups onto that of ``reference``, and why some are not aligned."""

    run: str
    origin: str
    reference: str
    aligned: Mapping[str, AlignedClock]
    refused: Mapping[str, str]
    delays: Mapping[str, float | None] = field(default_factory=dict)
    """Delay of the filter of each group's logger [s], which is taken off; None where the rig states no filter."""
    by_start_times: Mapping[str, float] = field(default_factory=dict)
    """Offset of each group's clock [s] as the start times of the two logs have it, where they say."""

    def map_of(self, group: str) -> ClockMap:
        """The map of a group's clock. Raises AnalysisError, saying why, if there is none."""
        if group == self.reference:
            return same_clock((0.0, 0.0))
        if group not in self.aligned:
            raise AnalysisError(self.refusal(group))
        return self.aligned[group].clock

    def refusal(self, group: str) -> str:
        """Why there is no map of a group's clock."""
        return f"{self.run}: {group} is not aligned: {self.refused.get(group, 'it was not requested')}"

    @property
    def findings(self) -> list[str]:
        """Gaps that were masked, by run and group; logs whose start times say that they are of different times."""
        found = [f"{self.run}: {group}: {text}" for group, one in self.aligned.items() for text in one.findings]
        for group, one in self.aligned.items():
            stated = self.by_start_times.get(group, one.clock.offset)
            if abs(stated - one.clock.offset) > _START_TIMES_AGREE_S:
                found.append(
                    f"{self.run}: {group}: by the start times of the logs its offset is {stated:.3f} s, by the signals "
                    f"{one.clock.offset:.3f} s: a logger's calendar is wrong, or the logs are of different runs"
                )
        return found

    @property
    def rows(self) -> "list[GroupClock]":
        """The alignments, as they are stored and shown."""
        shared, own = (self.run, self.origin, self.reference), self.delays.get(self.reference)
        return [
            GroupClock(*shared, group, one, self.delays.get(group), own, self.by_start_times.get(group))
            for group, one in self.aligned.items()
        ]


@dataclass(frozen=True)
class GroupClock:
    """The clock of one group of a run."""

    run: Annotated[str, Key("", "run")]
    origin: Annotated[str, Key()]
    reference: Annotated[str, Key()]
    group: Annotated[str, Key("", "group")]
    aligned: Annotated[AlignedClock, INLINE]
    delay: Annotated[float | None, Key("filter_delay_s")]
    """Delay of the filter of the group's logger [s]."""
    reference_delay: Annotated[float | None, Key("reference_filter_delay_s")]
    by_start_times: Annotated[float | None, Key("offset_by_start_times_s")]
    """Offset by the start times that the logs state [s]."""


def align_run(
    run: SIRun,
    mechanism: Callable[[], Mechanism],
    reference: str | None = None,
    drift: bool = True,
    cutoff: float | None = None,
    method: AlignmentMethod = by_correlation,
    among: Collection[str] | None = None,
    pairs: SignalPairs = signal_pairs,
) -> RunClocks:
    """Align all groups, or those ``among``, by what both recorded by the rig; the encoders' group is the reference
    unless another is named. The base's accelerometers are aligned in any case: others need them. ``pairs`` are the
    signals that are compared, best first.

    Raises AnalysisError if the run has one group only.
    """
    if len(run.groups) < 2:
        raise AnalysisError(f"{run.name}: one logger, one clock: there is nothing to align")
    reference = reference or reference_group(run)
    run.group(reference)
    motion = RunMotion(run, mechanism, cutoff)
    known = {reference: same_clock((0.0, 0.0))}
    aligned: dict[str, AlignedClock] = {}
    refused: dict[str, str] = {}
    base = base_motion.base_acceleration(run)
    first = base.group if base is not None else None
    others = [g.name for g in run.groups if g.name != reference and (among is None or g.name in {first, *among})]
    for group in sorted(others, key=lambda name: name != first):
        found = _first_determined(pairs(motion, reference, group, known), drift, method)
        if isinstance(found, AlignedClock):
            aligned[group], known[group] = found, found.clock
        else:
            refused[group] = found
    delays = {group.name: delay_of(run, group.name) for group in run.groups}
    return RunClocks(run.name, run.origin, reference, aligned, refused, delays, _stated_offsets(run, reference))


def reference_group(run: SIRun) -> str:
    """The group whose clock is the reference unless another is named: that of the encoders, else the first."""
    encoders = run.rig.columns_of(Encoder)
    recording = (g.name for column in encoders for g in run.groups if run.holds(column, g.name))
    return next(recording, run.groups[0].name)


def _first_determined(found: Iterable[SignalBuilder], drift: bool, method: AlignmentMethod) -> AlignedClock | str:
    """The first candidate that determines the clock, or why none does."""
    reasons: list[str] = []
    for build in found:
        shared = None
        try:
            shared = build(None)
            if shared.partial:  # a first map lets the base's motion be taken out of the signals
                shared = build(method(shared, False).clock)
            return method(shared, drift)
        except CounterpoiseError as error:
            reasons.append(f"{error}{shared.caution if shared else ''}")
    return "; ".join(reasons) or (
        "the rig names nothing that both loggers recorded: encoders on the reference's logger can align with force "
        "sensors of supports and accelerometers on moving bodies, sensors of one quantity with each other, and base "
        "accelerometers with nothing else; name a channel of each, --pair A=B, or record a trigger or a tap"
    )


def align_named(
    run: Run, reference: str, own: str, drift: bool, cutoff: float | None, method: AlignmentMethod
) -> RunClocks:
    """Align two groups by a channel of each, which the user names."""
    there, here = (run.find(channel)[0].name for channel in (reference, own))
    if there == here:
        raise AnalysisError(f"{run.name}: {reference!r} and {own!r} are in one group, {here}: they share a clock")
    found = method(named_channels(run, reference, own, cutoff), drift)
    delays = {group: delay_of(SIRun.of(run), group) for group in (there, here)} if run.rig is not None else {}
    return RunClocks(run.name, run.origin, there, {here: found}, {}, delays, _stated_offsets(run, there))


def _stated_offsets(run: Run | SIRun, reference: str) -> dict[str, float]:
    """Offsets of the groups' clocks [s] by when the logs say that each shows zero."""
    zeros = {group.name: group.zero for group in run.groups if group.zero is not None}
    if (there := zeros.get(reference)) is None:
        return {}
    alike = {group: zero for group, zero in zeros.items() if zero.has_zone == there.has_zone}
    return {group: (zero.nanoseconds - there.nanoseconds) / 1e9 for group, zero in alike.items()}


KIND = "alignment"


def write_alignments(campaign: Path, runs: Sequence[tuple[Path, RunClocks]]) -> Path:
    """Add a record of the alignments of stored runs; returns its file."""
    rows = plain([row for _, clocks in runs for row in clocks.rows])
    return append_only_records.append_record(campaign, KIND, [path for path, _ in runs], {"alignments": rows})


def stored_clock_maps(run: Path, reference: str | None = None) -> dict[str, ClockMap]:
    """The newest stored map of each clock of a run onto that of ``reference``, or of the reference of the newest; empty
    where there is none."""
    rows = [
        row
        for record in append_only_records.about(run.parent, KIND, run)
        for row in record.content.get("alignments", [])
        if row["run"] == run.stem and reference in (None, row["reference"])
    ]
    if not rows:
        return {}
    onto = rows[-1]["reference"]
    found = {row["group"]: ClockMap.from_dict(row) for row in rows if row["reference"] == onto}
    return found | {onto: same_clock((0.0, 0.0))}
