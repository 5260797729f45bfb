"""A campaign's plan: which runs, with which payload, counter-masses, motion and acceleration (``datasets/plans``)."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field
from pydantic.json_schema import SkipJsonSchema

from balance import datasets
from balance.errors import CounterpoiseError, DataError
from balance.input_files import Measured, OneOrMore, Table, load_model, model_from_table, toml_tables
from balance.units import G0

from .errors import RigError
from .recording import Conditions
from .rig import key_types

if TYPE_CHECKING:
    from balance.mechanism.mechanism import Mechanism


@dataclass(frozen=True)
class PlannedRun:
    """One run, to be set up at the bench or simulated."""

    name: str
    payload: float | None
    """Everything that the platform carries, itself included [kg]; None for a mechanism that carries none."""
    counter_masses: dict[str, float]
    """Counter-mass by site [kg]; empty without counter-masses."""
    motion: str
    peak_acceleration: float | None
    """Peak acceleration of the motion [m/s2, or rad/s2 where it is ``turning``]; None: that of the motion's file."""
    repeat: int
    turning: bool = False
    """Whether the peak acceleration is one of joints that turn."""
    payloads: Mapping[str, float] = field(default_factory=dict)
    """Further payloads: all that a body carries, itself included, or what is added at a site [kg]."""

    @property
    def conditions(self) -> Conditions:
        """The run's conditions as they are stored with a run."""
        found = Conditions(counter_masses=self.counter_masses, motion=self.motion, repeat=self.repeat)
        if self.payload is not None:
            found["payload_kg"] = self.payload
        if self.payloads:
            found["payloads"] = dict(self.payloads)
        if self.peak_acceleration is not None and self.turning:
            found["peak_acceleration_rad_s2"] = self.peak_acceleration
        elif self.peak_acceleration is not None:
            found["peak_acceleration_g"] = round(self.peak_acceleration / G0, 12)
        return found

    def contradictions(self, mechanism: "Mechanism") -> Iterator[str]:
        """What it carries that ``mechanism`` cannot, by key."""
        for site, mass in self.counter_masses.items():
            try:
                mechanism.with_counter_mass({site: mass})
            except CounterpoiseError as error:
                yield f"counter_masses: {error}"
        try:
            mechanism.with_payload(self.payloads, self.payload)
        except CounterpoiseError as error:
            yield f"payload: {error}"


_ONE_OR_MORE = (OneOrMore, Field(min_length=1))


class Condition(Table):
    """Runs in every combination of what is listed, each also without counter-masses (see ``also_without``)."""

    payload: Annotated[list[key_types.Mass], *_ONE_OR_MORE] | None = None
    """All that the payload's body carries, itself included, one or a list [kg]; left out: the mechanism as it is."""
    payloads: dict[str, key_types.Mass] = Field(default_factory=dict)
    """By body all that it carries, itself included; by site a mass added there [kg]."""
    counter_masses: dict[str, key_types.Mass] = Field(default_factory=dict)
    """Counter-masses by site [kg]."""
    motion: Annotated[list[str], *_ONE_OR_MORE]
    """Name or file of a motion, one or a list."""
    peak_acceleration: Annotated[list[key_types.PeakAcceleration], *_ONE_OR_MORE] | None = None
    """Peak acceleration of the motion, one or a list [m/s2 or rad/s2]; left out: that of the motion's file."""
    also_without: bool = True
    """Whether every run is made without counter-masses too."""

    def runs(self) -> Iterator[PlannedRun]:
        """Every combination once, without name or repeat; runs with counter-masses first."""
        sets = [self.counter_masses] + [{}] * (self.also_without and bool(self.counter_masses))
        payloads: list[float | None] = [*(self.payload or ())] or [None]
        peaks: list[Measured[float] | None] = [*(self.peak_acceleration or ())] or [None]
        for payload, motion, peak in product(payloads, self.motion, peaks):
            turning = peak is not None and peak.dimension == "angular acceleration"
            for masses in sets:
                yield PlannedRun("", payload, masses, motion, peak and peak.value, 0, turning, self.payloads)


class Plan(Table):
    """A campaign of runs of one mechanism."""

    mechanism: str
    """A shipped mechanism by name, or a file."""
    payload_body: str | None = None
    """The body whose mass is the payload: checked against the mechanism's file, which names it."""
    repeats: int = Field(default=1, ge=1, le=1000)
    """How often every run is made."""
    seed: int = Field(default=0, ge=0)
    """Seed of the noise in simulated logs: the same seed, the same logs."""
    conditions: list[Condition] = Field(min_length=1)
    """Conditions of the runs."""
    source: SkipJsonSchema[str] = Field(default="plan", exclude=True)
    """What messages call its file."""

    def runs(self) -> list[PlannedRun]:
        """All runs in order, named ``r001``, ``r002``, ...; one that several conditions contain is made once."""
        distinct: dict[object, PlannedRun] = {}
        for run in (run for condition in self.conditions for run in condition.runs()):
            mounted = (frozenset(masses.items()) for masses in (run.payloads, run.counter_masses))
            distinct.setdefault((run.payload, *mounted, run.motion, run.peak_acceleration, run.turning), run)
        each = [(repeat, run) for run in distinct.values() for repeat in range(1, self.repeats + 1)]
        digits = max(3, len(str(len(each))))
        return [replace(run, name=f"r{i:0{digits}d}", repeat=repeat) for i, (repeat, run) in enumerate(each, 1)]


def load_plan(name: str | Path) -> Plan:
    """Load a plan: a file, or a shipped one by name. Raises RigError, naming the key that is wrong."""
    try:
        path = datasets.find_dataset(name, "plans", ".toml")
    except DataError as error:
        raise RigError(str(error)) from error
    return load_model(Plan, path, RigError).model_copy(update={"source": path.name})


def plan_from_text(text: str, source: str = "plan") -> Plan:
    """Read a plan from its text; ``source`` is what messages call it."""
    return model_from_table(Plan, toml_tables(text, source, RigError), source, RigError)
