"""A stored run bound to its rig, in SI: calibrations, units, masks and findings are looked up here and nowhere after.

Channels are computed when they are first read and cached with the run; what goes through a campaign therefore keeps
stored runs and binds them one after the other. ``physical`` gives the same as a run whose channels are in SI.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from balance.arrays import Floats, Mask
from balance.errors import UnitError
from balance.results import instant_text, plain
from balance.units import G0, SI_UNITS, factor_to_si

from .. import units
from ..calibration.definition import is_electrical, unit_of_log
from ..calibration.evaluation import CalibrationLaw, bind_sensor, relative_uncertainty
from ..errors import AnalysisError
from ..quality.clipping import flat_tops, is_dead
from ..recording import Channel, Conditions, Finding, Origin, Samples, Severity, TimeColumn, worst_severity
from ..rig import Column, Rig, rig_from_text
from ..store.run import Run, StoredGroup
from .calibration_history import CalibrationInForce, CalibrationRecord

_CURE = "correct the log and ingest it into another folder, or leave the run out"
_CURE_OF_GAPS = "export the log again, where that lost them, and ingest it into another folder, or leave the run out"
_LARGEST = 1e100
"""What no sensor shows [SI]; squares of larger values could not be added up."""
KEPT_SAMPLES = 1 << 20
"""Of a channel in memory as recorded, up to which it is kept in SI as well."""
AT_RANGE = 1.0 - 1e-4
"""Share of its range from which a sensor counts as saturated."""
MOST_MISSING = 3
"""Samples without a number in a row that are interpolated; more of them are refused."""
MISSING_SHARE = 1e-3
"""Largest share of a channel's samples without a number, or left out, that is interpolated [-]."""
INTERPOLATED = ("not_a_number", "time_gap")
"""Findings of what is interpolated, where it is not refused."""
_LEFT_OUT = "; left out at the ends of the record, as are the logger's other channels there"
_INTERPOLATED = "; interpolated between the samples beside them"
_NEAR_PEAK = 0.9
"""Of the largest deviation from the median [-]: beside such a reading what is missing may be an overload."""
RESOLVED_BY_CALIBRATION = frozenset({"uncalibrated", "calibration_contradiction"})
"""Findings that a later calibration resolves; until then reading the channel is refused."""


@dataclass(frozen=True)
class SensitivityUncertainty:
    """Of a channel in one run: one error since the calibration, the same in all runs that share it."""

    relative: float
    """Standard uncertainty, as a share of the sensitivity [-]."""
    degrees_of_freedom: float
    source: str
    """Certificate, record or rig that states it."""
    calibration: object
    """What states it: runs of one sensor for which this is equal share the error."""


@dataclass(frozen=True, eq=False)
class SIRun:
    """One stored run and the rig that describes it; made by :meth:`of`. Everything in SI.

    A channel is named by its :class:`Column` in the rig. Errors of a channel are raised when it is read.

    >>> import testbench
    >>> run = testbench.SIRun.of(testbench.open_run("campaign/r001.h5"))
    >>> run.signal(run.rig.base_columns[0])[1]
    5000.0
    """

    recorded: Run
    """The stored run, in the loggers' units."""
    rig: Rig
    _preloaded: Mapping[tuple[str, int], Samples] = field(default_factory=dict, repr=False)
    """Recorded values that are in memory, by group and index."""
    whole: bool = False
    """Whether samples at the ends of a record without a number in some channel of its logger are not left out."""
    _laws: dict[str, CalibrationLaw | None] = field(default_factory=dict, init=False, repr=False)
    _values: dict[str, Floats] = field(default_factory=dict, init=False, repr=False)
    _sound: dict[str, Floats] = field(default_factory=dict, init=False, repr=False)
    """Those of ``_values`` of which all is known to be numbers that something measures."""
    _times: dict[str, Floats] = field(default_factory=dict, init=False, repr=False)
    _steps: dict[str, NDArray[np.intp] | None] = field(default_factory=dict, init=False, repr=False)
    _ends: dict[str, tuple[slice, frozenset[str]]] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, run: Run, rig: Rig | None = None) -> "SIRun":
        """Bind a run to the rig that is stored with it, or to the one given. Raises AnalysisError without either."""
        if rig is None and run.rig is None:
            raise AnalysisError(
                f"{run.name}: stored without a rig, so that no channel has a sensor: ingest its logs into another "
                'folder with --rig RIG.toml; testbench new writes one (mechanism = "none": without a model)'
            )
        return cls(run, rig or _stored_rig(run.rig or ""))

    @property
    def name(self) -> str:
        """The run's name."""
        return self.recorded.name

    @property
    def path(self) -> Path:
        """Its file."""
        return self.recorded.path

    @property
    def origin(self) -> Origin:
        """Measured, simulated, or unstated."""
        return self.recorded.origin

    @property
    def conditions(self) -> Conditions:
        """Payload, counter-masses and motion, by the run table."""
        return self.recorded.conditions

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What ingest found odd."""
        return self.recorded.findings

    @property
    def groups(self) -> tuple[StoredGroup, ...]:
        """Groups of channels, each with its clock."""
        return self.recorded.groups

    def group(self, name: str) -> StoredGroup:
        """The group of this name. Raises StoreError if there is none."""
        return self.recorded.group(name)

    def group_of(self, column: Column) -> str:
        """The name of the group that holds a channel. Raises StoreError if none or several do."""
        return self.recorded.find(column.channel)[0].name

    def groups_of(self, columns: Iterable[Column]) -> list[str]:
        """Names of the groups that hold channels, sorted; one name: they share a clock."""
        return sorted({self.group_of(column) for column in columns})

    def holds(self, column: Column, group: str | None = None) -> bool:
        """Whether a channel was recorded, in any group or in this one."""
        among = self.groups if group is None else (self.group(group),)
        return any(one.index(column.channel) is not None for one in among)

    def time(self, group: str) -> Floats:
        """Instants of a group's samples on its own clock, (n,) [s]."""
        if group not in self._times:
            self._times[group] = self.recorded.time(group)[self._used(group)[0]]
        return self._times[group]

    @cached_property
    def _without_number(self) -> set[str]:
        """Channels with samples that are no number, unless the run is read whole."""
        odd = [found for found in self.findings if found.code == "not_a_number" and not self.whole]
        return {
            column.channel for column in self.rig.columns() for found in odd if column.channel in self._names(found)
        }

    def _used(self, group: str) -> tuple[slice, frozenset[str]]:
        """The samples of a group that are used, and the channels without a number at an end, for which others are not.

        At most MOST_MISSING samples at an end are left out, away from peaks, of all channels of the logger.
        """
        if group not in self._ends:
            used, names = slice(0, self.group(group).samples), set[str]()
            for column in self.rig.columns() if self._without_number else ():
                if not self.holds(column, group) or column.channel not in self._without_number:
                    continue
                values = self.recorded.channels_at([self.recorded.find(column.channel)])[0]
                known = np.flatnonzero(~np.isnan(values))
                first, last = (int(known[0]), int(known[-1])) if known.size else (0, -1)
                beside = [at for at, lost in ((first, first), (last, len(values) - 1 - last)) if lost]
                few = max(first, len(values) - 1 - last) <= MOST_MISSING
                if beside and few and not (_may_overload(column) and (_reach(values)[beside] > _NEAR_PEAK).any()):
                    used = slice(max(used.start, first), min(used.stop, last + 1))
                    names.add(column.channel)
            self._ends[group] = (used, frozenset(names))
        return self._ends[group]

    def _lacks_within(self, column: Column) -> bool:
        """Whether a channel has no number at samples that are used, and not only at the ends, which are left out."""
        (values,) = self.recorded.channels_at([self.recorded.find(column.channel)])
        return bool(np.isnan(values[self._used(self.group_of(column))[0]]).any())

    def instants(self, column: Column) -> Floats:
        """Instants of what a channel's samples show, on its logger's clock, (n,) [s].

        Where the rig states the logger's filter (``low_pass``), that is earlier than the sample by the filter's delay.
        """
        time = self.time(self.group_of(column))
        return time - column.delay if column.delay else time

    def rate(self, column: Column) -> float:
        """Sampling rate [Hz]. Raises AnalysisError where a channel has no regular clock."""
        group, _ = self.recorded.find(column.channel)
        if group.rate_hz is None:
            raise AnalysisError(
                f"{self.name}: channel {column.channel!r} has no sampling rate: expected a regular clock"
            )
        return group.rate_hz

    def values(self, column: Column) -> Floats:
        """A channel (n,) [SI]; single samples without a number are interpolated between their neighbours.

        Up to MOST_MISSING in a row, away from its peaks; :meth:`doubts` says so. Raises AnalysisError for no or two
        units, no rate, or more samples that are no number.
        """
        self.rate(column)
        values = self.readings(column)
        if values is self._sound.get(column.channel):
            return values
        if values.size and np.isnan(values.min()):  # quicker than looking at each
            values = self.without_holes(column, values)
        if values.size and not (values.min() > -_LARGEST and values.max() < _LARGEST):  # of NaN neither is true
            odd = np.flatnonzero(~(np.abs(values) < _LARGEST))
            at = odd[0] + self._used(self.group_of(column))[0].start
            what = f"{values[odd[0]]:g} SI, which nothing measures, at sample {at}"
            raise AnalysisError(f"{self.name}: channel {column.channel!r} holds {what}: {_CURE}")
        if values is self._values.get(column.channel):
            self._sound[column.channel] = values
        return values

    def without_holes(self, column: Column, values: Floats, steps: NDArray[np.intp] | None = None) -> Floats:
        """Values (n,) of a channel, in any unit, with what is missing (NaN) from those about it: see :meth:`values`.

        ``steps`` (m,) [samples] are those that its clock has, where it left out the others.
        Raises AnalysisError where that would be a guess.
        """
        missing = np.isnan(values)
        if not missing.any():
            return values
        edges = np.flatnonzero(np.diff(missing, prepend=False, append=False))
        begins, ends = edges[::2], edges[1::2]
        beside = np.concatenate([begins - 1, np.minimum(ends, len(values) - 1)])
        first, longest = 0, int(np.argmax(ends - begins))
        if begins[0] == 0 or ends[-1] == len(values):
            first = 0 if begins[0] == 0 else len(begins) - 1
            why = "at the beginning or end of the record, where any value would be invented: cut these rows off the log"
        elif ends[longest] - begins[longest] > MOST_MISSING:
            first, why = longest, f"more than {MOST_MISSING} in a row"
        elif missing.sum() > max(MISSING_SHARE * len(values), MOST_MISSING):
            more = missing.sum() - ends[0] + begins[0]
            why = f"and {f'at {more}' if steps is None else more} more, above {MISSING_SHARE:.1%} of them"
        elif _may_overload(column) and (peak := _reach(values)[beside] > _NEAR_PEAK).any():
            first, why = (
                int(np.flatnonzero(peak)[0]) % len(begins),
                "beside its largest readings, where "
                + ("an overload may be hidden" if steps is None else "the largest may be missing"),
            )
        else:
            return np.where(
                missing, np.interp(np.arange(len(values)), np.flatnonzero(~missing), values[~missing]), values
            )
        begin, end = int(begins[first]), int(ends[first])
        many = end - begin
        if steps is None:
            begin, end = (at + self._used(self.group_of(column))[0].start for at in (begin, end))
            where = f"at sample {begin}" if many == 1 else f"at samples {begin} to {end - 1}"
            raise AnalysisError(f"{self.name}: channel {column.channel!r} holds no number {where}, {why}: {_CURE}")
        at = self.time(self.group_of(column))[int(np.searchsorted(steps, begin)) - 1]
        raise AnalysisError(
            f"{self.name}: the clock of channel {column.channel!r} leaves out {many} sample{'s' * (many > 1)}, "
            f"{many / self.rate(column):.4g} s, after {instant_text(at)} s, {why}: {_CURE_OF_GAPS}"
        )

    def signal(self, column: Column) -> tuple[Floats, float]:
        """A channel at even steps (n,) [SI] and its rate [Hz]; raises as :meth:`values` and :meth:`evenly`."""
        return self.evenly(column, self.values(column)), self.rate(column)

    def evenly(self, column: Column, values: Floats, bridged: bool = False) -> Floats:
        """Values (n,) of a channel, in any unit, at even steps of its clock, (m,): what it left out is interpolated.

        By the rules of :meth:`values`. Raises AnalysisError where that would be a guess; with ``bridged`` gaps of any
        length are straight lines, for who masks them.
        """
        steps, rate = self._even_steps(column), self.rate(column)
        if steps is None:
            return values
        if bridged:
            return np.interp(np.arange(steps[-1] + 1), steps, values)
        lost = np.diff(steps) - 1
        if (longest := int(lost.max())) > MOST_MISSING:
            at = self.time(self.group_of(column))[int(lost.argmax())]
            raise AnalysisError(
                f"{self.name}: the clock of channel {column.channel!r} leaves out {longest} samples, "
                f"{longest / rate:.4g} s, after {instant_text(at)} s; more than {MOST_MISSING} in a row are not "
                f"interpolated: {_CURE_OF_GAPS}"
            )
        even = np.full(int(steps[-1]) + 1, np.nan)
        even[steps] = values
        return self.without_holes(column, even, steps)

    def even_instants(self, column: Column) -> Floats:
        """Instants of :meth:`signal`, (n,) [s], as :meth:`instants`."""
        steps, time = self._even_steps(column), self.instants(column)
        return time if steps is None else np.interp(np.arange(steps[-1] + 1), steps, time)

    @cached_property
    def _has_gaps(self) -> bool:
        """Whether ingest found a clock that leaves samples out."""
        return any(found.code == "time_gap" for found in self.findings)

    def _even_steps(self, column: Column) -> NDArray[np.intp] | None:
        """Where the samples of a channel lie on even steps of its clock, (n,) [samples]; None: one on each."""
        group = self.group_of(column)
        if group not in self._steps:
            self._steps[group] = None
            if self._has_gaps and self.group(group).rate_hz is not None:
                from ..quality.time_steps import even_steps  # most runs need none of it

                self._steps[group] = even_steps(self.time(group), self.rate(column))
        return self._steps[group]

    def stacked(self, columns: Iterable[Column]) -> Floats:
        """Channels of one clock side by side, (n, k) [SI]; in memory one after the other, as they are worked on."""
        return np.array([self.values(column) for column in columns]).T

    def readings(self, column: Column) -> Floats:
        """A channel (n,) [SI] as its sensor gives it, NaN where the log holds no number."""
        if column.channel not in self._values:
            found = self._computed(column)
            if self._preloaded and found.size > KEPT_SAMPLES:
                return found
            self._values[column.channel] = found
            found.flags.writeable = False
        return self._values[column.channel]

    def loads(self, column: Column) -> Floats:
        """What the sensor carries along a component (n,) [SI]: its readings, with the rig's crosstalk taken out."""
        if column.crosstalk is None or self.has_matrix(column):
            return self.readings(column)
        every = np.stack([self.readings(sibling) for sibling in column.siblings])
        return np.asarray(np.linalg.solve(np.array(column.crosstalk), every)[column.index])

    def has_matrix(self, column: Column) -> bool:
        """Whether the calibration in force has a matrix, which takes the place of the rig's crosstalk."""
        found = self.calibration(column)
        return found is not None and found.calibration.matrix is not None

    def at_range(self, column: Column) -> Mask:
        """Samples at the end of the range that the rig states, (n,) [-]; none where it states none."""
        return np.asarray(np.abs(self.values(column)) >= AT_RANGE * (column.range or np.inf))

    def clipped(self, column: Column) -> Mask:
        """Samples at the end of the range, else at the extremes of a channel that is suspected to clip, (n,) [-]."""
        full = self.at_range(column)
        if full.any() or self.saturation(column) is None:
            return full
        values = self.values(column)
        return np.asarray((values == values.max()) | (values == values.min()))

    def saturation(self, column: Column) -> Finding | None:
        """Samples at the end of the stated range, or flat tops below it; without a range, what ingest suspected."""
        if column.range is None:
            code, message = self._suspected(column)
        elif count := int(np.count_nonzero(self.at_range(column))):
            code, message = (
                "clipping",
                f"{column.channel}: {count} samples at the end of its range of {column.range:g} (SI)",
            )
        else:
            flat = flat_tops(self.values(column), SI_UNITS[column.dimensions[0]])
            code, message = "clipping_suspected", flat and f"{column.channel}: {flat}"
        return self._finding(code, column.channel, f"{self.name}: {message}") if message else None

    def is_dead(self, column: Column) -> bool:
        """Whether a channel shows one value only."""
        return is_dead(self.values(column))

    def interpolated(self, columns: Iterable[Column]) -> list[Finding]:
        """Those of :meth:`doubts` that say what is interpolated."""
        return [found for found in self.doubts(columns) if found.code in INTERPOLATED]

    def doubts(self, columns: Iterable[Column]) -> list[Finding]:
        """Warnings of ingest about channels, except those that a later calibration resolves; about clocks of which
        :meth:`signal` interpolates what they left out; and what a person accepted, for which a run is else refused.
        """
        columns = list(columns)
        used, accepted = {column.channel for column in columns}, set[str | None]({None})
        held = [column for column in columns if self._without_number and self.holds(column)]
        cut = set[str]().union(*(self._used(self.group_of(column))[1] for column in held))
        ends_alone = {column.channel for column in held if column.channel in cut and not self._lacks_within(column)}
        for column in columns if self._has_gaps or worst_severity(self.findings) is Severity.ERROR else ():
            if self.holds(column) and isinstance(
                clock := (group := self.group(self.group_of(column))).clock, TimeColumn
            ):
                accepted.add(group.channels[clock.index].name)
                used |= set() if self._even_steps(column) is None else {group.channels[clock.index].name}
        return [
            self._finding(
                found.code,
                found.channel,
                f"{self.name}: {found.channel}: {found.message}"
                + ("" if cut.isdisjoint(self._names(found)) else _LEFT_OUT)
                + (_INTERPOLATED if found.code in INTERPOLATED and ends_alone.isdisjoint(self._names(found)) else "")
                + ("; accepted when it was stored" if found.severity is Severity.ERROR else ""),
            )
            for found in self.findings
            if found.code not in RESOLVED_BY_CALIBRATION
            and found.severity >= Severity.WARNING
            and (
                not (used | cut).isdisjoint(self._names(found))
                or (found.severity is Severity.ERROR and found.channel in accepted)
            )
        ]

    def calibration(self, column: Column) -> CalibrationInForce | None:
        """What is in force for a channel's sensor: the newest record about this run, else the rig's; None: neither.

        Raises StoreError where the newest record is about other bytes than those stored.
        """
        from . import calibration_history

        record = self._records.get(column.sensor)
        if record is not None:
            calibration_history.refuse_other_bytes(record, self.path)
            return calibration_history.CalibrationInForce.by_record(record, self.name)
        if column.calibration is not None:
            return calibration_history.CalibrationInForce(column.sensor, column.calibration, "rig", runs=(self.name,))
        return None

    def sensitivity_uncertainty(self, column: Column) -> "SensitivityUncertainty | None":
        """How well a channel's sensitivity is known; None where neither its calibration nor the rig states it.

        By the calibration in force, else by the errors that the rig's bench states of its sensors.
        """
        found = self.calibration(column)
        relative = None if found is None else relative_uncertainty(found.calibration, column)
        if found is not None and relative is not None:
            assert found.calibration.uncertainty is not None
            freedom = found.calibration.uncertainty.degrees_of_freedom
            return SensitivityUncertainty(relative, freedom or np.inf, found.calibration.reference or found.source,
                                          found.calibration)  # fmt: skip
        errors = self.rig.bench.errors.get(column.sensor)
        if errors is None or not errors.sensitivity:
            return None
        return SensitivityUncertainty(errors.sensitivity, np.inf, "rig, bench.errors", errors)

    @property
    def calibrations(self) -> list[CalibrationInForce]:
        """All that are in force for sensors of which something is recorded, in the order of the rig."""
        sensors = {column.sensor: column for column in self.rig.columns() if self.holds(column)}
        return [found for column in sensors.values() if (found := self.calibration(column)) is not None]

    def dimension(self, column: Column) -> str:
        """Quantity that a channel measures by its unit, of those that it may: of an encoder an angle or a length."""
        for found in column.dimensions[:-1]:
            narrow = replace(column, dimensions=(found,))
            try:
                if self._law(replace(narrow, siblings=(narrow,))) is None:
                    self._factor(narrow)
            except AnalysisError:
                continue
            return found
        return column.dimensions[-1]

    def written_unit(self, column: Column) -> str | None:
        """The unit that the log writes for a channel; None where it writes none."""
        group, index = self.recorded.find(column.channel)
        return group.channels[index].unit

    def preloaded(self, columns: Iterable[Column], begin: int = 0, end: int | None = None) -> "SIRun":
        """The same run with these channels in memory as recorded, read in one opening of its file.

        Long ones are not kept in SI.
        With ``begin`` and ``end`` they are those samples alone: for :meth:`readings`, not for what asks for instants.
        """
        places = [self.recorded.find(column.channel) for column in columns]
        if (begin, end) == (0, None) and all((g.name, i) in self._preloaded for g, i in places):
            return self
        values = self.recorded.channels_at(places, begin, end)
        loaded = {(group.name, i): v for (group, i), v in zip(places, values, strict=True)}
        return SIRun(self.recorded, self.rig, loaded, self.whole or (begin, end) != (0, None))

    @cached_property
    def _records(self) -> Mapping[str, CalibrationRecord]:
        """The newest calibration of each sensor that a record about this run gives."""
        from . import calibration_history

        return calibration_history.newest_by_sensor(self.path)

    @cached_property
    def _channels(self) -> dict[str, Channel]:
        """The channels by their names in the log."""
        return {c.name: c for group in self.groups for c in group.channels}

    def _suspected(self, column: Column) -> tuple[str, str | None]:
        """Code and message of the clipping that ingest suspected of a channel; no message: of none."""
        for found in self.findings:
            if found.code.startswith("clipping") and column.channel in self._names(found):
                return found.code, found.message
        return "", None

    def _names(self, finding: Finding) -> frozenset[str]:
        """What a rig may call the channel that a finding is about."""
        name = finding.channel or ""
        return self._channels[name].names if name in self._channels else frozenset({name})

    def _finding(self, code: str, channel: str | None, message: str) -> Finding:
        return Finding(code, channel, self.name, message)

    def _computed(self, column: Column) -> Floats:
        if column.sensor not in self._laws:
            self._laws[column.sensor] = self._law(column)
        law = self._laws[column.sensor]
        if law is None:
            return self.as_recorded(column) * self._factor(column)
        return law.component(column.index, lambda i: self.as_recorded(column.siblings[i]))

    def as_recorded(self, column: Column) -> Samples:
        """A channel in the unit of its log, (n,)."""
        group, index = self.recorded.find(column.channel)
        found = self._preloaded.get((group.name, index))
        return (self.recorded.channel_at(group.name, index) if found is None else found)[self._used(group.name)[0]]

    def _law(self, column: Column) -> CalibrationLaw | None:
        """From the channels of a sensor to SI; None where no calibration is in force."""
        found = self.calibration(column)
        if found is None:
            return None
        try:
            return bind_sensor(found.calibration, column.siblings, [self.written_unit(c) for c in column.siblings])
        except UnitError as error:
            raise AnalysisError(f"{self.name}: sensor {column.sensor}: {error}") from error

    def _factor(self, column: Column) -> float:
        """SI per unit without a calibration; the log's unit and the rig's must agree where both are given."""
        where = f"{self.name}: channel {column.channel!r}"
        written = unit_of_log(self.written_unit(column), column.unit if column.stated else None)
        if written and column.unit and column.stated and not units.same_unit(written, column.unit):
            raise AnalysisError(f"{where} is in {written!r} by its log and in {column.unit!r} by the rig: correct one")
        unit = written or column.unit
        if not unit:
            raise AnalysisError(
                f"{where} has no unit, neither in its log nor in the rig: state sensors.{column.sensor}.unit"
            )
        try:
            return factor_to_si(unit, *column.dimensions)
        except UnitError as error:
            hint = ""
            if is_electrical(unit):
                hint = f": calibrate it: testbench calibrate {self.path} {column.sensor} --sensitivity ... --reason ..."
            raise AnalysisError(f"{where}: {error}{hint}") from error


def _may_overload(column: Column) -> bool:
    """Whether a channel measures by what may overload."""
    return column.level and not column.commanded and "angle" not in column.dimensions


def _reach(values: Floats) -> Floats:
    """Deviations of values (n,) from their median over the largest of them, (n,) [-]; NaN where there is no number."""
    apart = np.abs(values - np.nanmedian(values))
    return np.asarray(apart / max(float(np.nanmax(apart)), 1e-300))


def calibrations_in_force(runs: Iterable[SIRun]) -> list[CalibrationInForce]:
    """All calibrations in force in runs, each once with its runs, by sensor."""
    found: dict[tuple[str, str, str], CalibrationInForce] = {}
    for one in (one for run in runs for one in run.calibrations):
        key = (one.sensor, one.source, str(one.calibration))
        before = found.get(key)
        found[key] = one if before is None else replace(before, runs=(*before.runs, *one.runs))
    return sorted(found.values(), key=lambda one: one.sensor)


@cache
def _stored_rig(text: str) -> Rig:
    return rig_from_text(text, "stored rig")


@dataclass(frozen=True)
class PhysicalRun(Run):
    """A stored run in SI: channels of the rig as calibrated now, all others as recorded.

    Values are computed on reading; ``provenance["calibrations"]`` states by which calibrations, of
    accelerations ``provenance["g0_m_per_s2"]`` what ``g`` is taken to be.
    """

    si: SIRun
    columns: Mapping[tuple[str, int], Column]
    """Channels of the rig by group and index."""

    def channels_at(
        self, places: Sequence[tuple[StoredGroup, int]], begin: int = 0, end: int | None = None
    ) -> list[Samples]:
        """Values of channels by group and index, (n,) each, in SI where the rig knows them, else as recorded."""
        return [
            self.si.recorded.channels_at([(group, index)], begin, end)[0]
            if (column := self.columns.get((group.name, index))) is None
            else np.asarray(self.si.loads(column), dtype=np.float64)[begin:end]
            for group, index in places
        ]


def physical(run: Run) -> PhysicalRun:
    """A stored run in SI by the rig that is stored with it. Raises AnalysisError if there is none.

    >>> import testbench
    >>> run = testbench.physical(testbench.open_run("campaign/r001.h5"))
    >>> list(run.to_pandas("r001_daq").columns)
    ['AccX (m/s^2)', 'AccY (m/s^2)', 'AccZ (m/s^2)', 'PlatX (m/s^2)', 'PlatY (m/s^2)']
    """
    if isinstance(run, PhysicalRun):
        return run
    si = replace(SIRun.of(run), whole=True)
    places = {}
    for column in si.rig.columns():
        if si.holds(column):
            group, index = run.find(column.channel)
            places[group.name, index] = column
    units = {place: SI_UNITS[si.dimension(column)] for place, column in places.items()}
    given = {f.name: getattr(run, f.name) for f in fields(Run)}
    given["groups"] = tuple(_in_si(group, units) for group in run.groups)
    given["provenance"] = {**run.provenance, "calibrations": plain(calibrations_in_force([si]))}
    if SI_UNITS["acceleration"] in units.values():
        given["provenance"]["g0_m_per_s2"] = G0
    return PhysicalRun(**given, si=si, columns=places)


def _in_si(group: StoredGroup, units: Mapping[tuple[str, int], str]) -> StoredGroup:
    channels = list(group.channels)
    for i, channel in enumerate(channels):
        if (unit := units.get((group.name, i))) is not None:
            channels[i] = Channel(f"{channel.label} ({unit})", unit, channel.label)
    return replace(group, channels=tuple(channels))
