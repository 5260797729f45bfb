"""What witnesses state about a run, and what the run table or the other runs state about it.

Findings that a person accepts, with name and reason: records of a campaign, entered into its ledger.

A decision is about a code in the runs that had it then, by their SHA-256; it holds for no other run. One that was wrong
is taken back as any record is, with name and reason: `testbench remove`.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from balance.results import Key
from balance.units import dimension_of, factor_to_si

from ..calibration.definition import is_electrical
from ..calibration.evaluation import Column
from ..errors import StoreError
from ..recording import Finding
from ..runs.si_run import SIRun
from ..store import Run, append_only_records
from ..store.run import identities

WITHHOLDING = frozenset({
    "counter_mass_contradiction", "axis_contradiction", "gain_contradiction", "flat_channel", "copied_run",
    "short_record",
})  # fmt: skip
"""Contradictions after which a number is withheld; after others it is marked: it is right, but of another condition, or
of a sensor to look at."""
ADVICE = {
    "counter_mass_contradiction": "check which runs had counter-masses, correct the run table and ingest again",
    "axis_contradiction": "check which channel is which axis in the rig and the log, and whether the sensor was turned",
    "gain_contradiction": "check the sensor's unit, sensitivity and amplifier range; testbench calibrate corrects them",
    "flat_channel": "check the sensor, its cable and its supply; repeat the run",
    "level_drift": "check the sensor's zero and its supply; amplitudes leave it out unless --band starts at 0",
    "copied_run": "take out the run whose log it is not (testbench remove), and ingest the log that was meant",
    "short_record": "repeat the run, or leave it out (testbench remove): a part of the motion has other numbers",
    "payload_contradiction": "weigh the payload, correct the run table and ingest again",
    "acceleration_contradiction": "correct {column} in the run table and ingest again",
    "motion_contradiction": "correct the motion in the run table and ingest again",
    "encoder_contradiction": "check in rig and log which channel is which encoder, its sign, zero, scale and unit",
    "sign_contradiction": "check the direction in which the sensor is mounted and the sign of its sensitivity",
    "force_sign": "check its sign in the rig and the wiring, and whether it is exchanged with another channel",
    "unread_mechanism": "correct the mechanism's file and ingest into a new campaign, or give one by --mechanism FILE",
    "torque_contradiction": "check units in rig and log, payload and counter-masses in the run table",
}
"""All contradictions, and what to do about each."""

UNIT_SHARE = 0.1
"""Share by which a factor may differ from one, or from that of two units."""
LOG_UNITS = {
    "acceleration": ("m/s^2", "g", "mm/s^2"), "force": ("N", "kN", "lbf", "kgf"), "moment": ("N m", "N mm", "N cm"),
}  # fmt: skip
"""By quantity, units in which logs are."""


def misread(column: Column, factor: float) -> str:
    """Of which unit, read as another, readings are that are ``factor`` times too large [-]; empty where of none."""
    if not column.unit or is_electrical(column.unit):
        return ""
    dimension = dimension_of(f"1 {column.unit}", *column.dimensions)
    own = factor_to_si(column.unit, dimension)
    ratios = {log: own / factor_to_si(log, dimension) for log in LOG_UNITS.get(dimension, ())}
    near = (log for log, one in ratios.items() if abs(factor / one - 1.0) < UNIT_SHARE < abs(one - 1.0))
    return next((f", as of {log} read as {column.unit}" for log in near), "")


@dataclass(frozen=True)
class Statement:
    """One statement about a run, by one kind of witness."""

    run: Annotated[str, Key("", "run")]
    subject: Annotated[str, Key("", "about")]
    """``payload``, ``acceleration``, ``motion``, ``encoder`` (with what is wrong: its scale, unit, sign or joint),
    ``axis``, ``sign``, ``gain``, ``copy``, ``rest``, ``dead``, ``counter-masses``, ``record``, ``mechanism``."""
    channel: Annotated[str | None, Key("", "channel", lambda channel: channel or "-")]
    """The channel that it is about; None: the whole run."""
    stated: Annotated[str, Key("", "stated")]
    """By the run table, the rig or the other runs."""
    witnessed: Annotated[str, Key("", "witnessed")]
    """By the witness, with its interval where it has one."""
    witness: Annotated[str, Key("", "by")]
    code: Annotated[str | None, Key("", "finding", lambda code: code or "-")] = None
    """Of the contradiction; None where both agree."""
    others: Annotated[tuple[str, ...], Key(None, "")] = ()
    """Other runs that it is about, such as the one that was copied."""
    column: Annotated[str, Key(None, "")] = ""
    """Column of the run table to correct, where the code has several."""
    because: Annotated[str, Key(None, "")] = ""
    """Code of the contradiction from which this one may follow, and whose advice comes first."""
    changed: Annotated[str, Key(None, "")] = ""
    """The last run that agrees and the first that contradicts, where no run agrees after it; else empty."""

    @property
    def is_of_one_side(self) -> bool:
        """Whether this run contradicts or the ``others``, on the other side of what changed: nobody knows which."""
        return bool(self.changed and self.others)

    def concerns(self, channels: Collection[str | None]) -> bool:
        """Whether it is about one of ``channels``, or the whole run as what is made of encoders is."""
        of_the_run = self.channel is None or self.code in {"encoder_contradiction", "motion_contradiction"}
        return of_the_run or self.channel in channels

    @property
    def advice(self) -> Annotated[str | None, Key("", "what to do", lambda advice: advice or "-")]:
        """What to do about a contradiction."""
        if self.code is None:
            return None
        first = f"find what changed between {self.changed}; " if self.changed else ""
        return first + ADVICE[self.because or self.code].format(column=self.column)

    @property
    def finding(self) -> Finding:
        """The contradiction as a finding."""
        assert self.code is not None
        about = f"{self.channel}: {self.subject}" if self.channel else self.subject
        message = f"{self.run}: {about}: {self.stated}, but {self.witness}: {self.witnessed}; {self.advice}"
        return Finding(self.code, self.channel, " ".join((self.run, *self.others)), message)


KIND = "accepted"


@dataclass(frozen=True)
class Decision:
    """A finding that was accepted."""

    code: str
    by: str
    reason: str
    written: str
    """When, ISO 8601, UTC."""
    runs: tuple[str, ...]
    """Names of the runs for which it holds, of those asked about."""

    def __str__(self) -> str:
        runs = ", ".join(self.runs) if len(self.runs) < 5 else f"{len(self.runs)} runs"
        return f"accepted by {self.by} on {self.written[:10]} for {runs}: {self.reason}"


def accept(campaign: Path, code: str, runs: Sequence[Run], by: str, reason: str) -> Path:
    """Record that a person accepts a finding in runs that have it. Raises StoreError without a name or a reason."""
    if not runs:
        raise StoreError(f"{code!r}: no finding of these runs; nothing was recorded")
    if not by.strip() or not reason.strip():
        raise StoreError("expected a name and a reason: a finding is accepted by a person, who says why")
    content = {"code": code, "by": by.strip(), "reason": reason.strip()}
    return append_only_records.append_record(campaign, KIND, [run.path for run in runs], content)


def decisions(runs: Iterable[Run | SIRun]) -> list[Decision]:
    """What was accepted of runs as they are stored now, the oldest first."""
    known: dict[Path, list[append_only_records.Record]] = {}
    about: dict[tuple[Path, str], tuple[append_only_records.Record, list[str]]] = {}
    for run in runs:
        folder = run.path.parent
        if folder not in known:
            known[folder] = append_only_records.read_records(folder, KIND) if folder.is_dir() else []
        named = [record for record in known[folder] if run.path.name in record.runs]
        try:
            own = identities(run.path) if named else frozenset()
        except StoreError:  # whose digest is not there: not known to be what was decided about
            continue
        for record in named:
            if record.runs[run.path.name] in own:
                about.setdefault((folder, record.name), (record, []))[1].append(run.name)
    found = []
    for record, names in sorted(about.values(), key=lambda one: one[0].number):
        code, by, reason = (str(record.content.get(key)) for key in ("code", "by", "reason"))
        found.append(Decision(code, by, reason, record.written, tuple(names)))
    return found
