"""A rig and a motion against the logs: missing channels, units and rates that differ, ranges of sensors, durations.

The next units of time, ms and min, are a thousand times smaller and sixty times larger: where the unit is wrong, a log
lasts as many times too long or too short.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from balance.errors import suggestion
from balance.results import first_of

from ..recording import Channel, Finding, Group, Recording, SensorRange, TimeColumn, by_name, of_one_name
from ..units import same_unit
from .group_checks import GroupCheck, clock_findings, unit_assumed
from .time_steps import RATE_TOLERANCE

if TYPE_CHECKING:
    from ..rig import Column, Rig

FEWEST_SAMPLES = 4
"""Below which a log is no record: its rate cannot be told from a gap."""
LEAST_SHARE = 0.1
"""Of the motion's duration, below which a log does not hold that motion."""
IN_SECONDS = (0.5, 30.0)
"""Durations over that of the motion at which a time is in s: one in ms or min is so only where the log holds less than
6 % of the motion, or more than thirty of it."""
NOT_IN_SECONDS = (0.02, 300.0)
"""Durations over that of the motion beyond which a time is not in s."""
OF_ONE_RUN = (0.25, 4.0)
"""Durations over that of another logger of the run at which a time is in the unit of the other."""

Motion = tuple[str, float] | None
"""Name of the motion's file and its duration [s]; None where no motion is stored."""
_CODE = "rig_contradiction"
_FLAT = {"clipping_suspected", "constant_channel"}


def channel_ranges(rig: "Rig | None", recording: Recording) -> dict[str, SensorRange]:
    """The range of each channel that the rig states, in the unit of the log: its own where the rig states none."""
    logged = {name: c.unit for group in recording.groups for c in group.channels for name in c.names}
    columns = () if rig is None else rig.columns()
    units = ((c, c.unit if c.stated or c.calibration is not None else logged.get(c.channel) or c.unit) for c in columns)
    limits = ((column.channel, column.written_range(unit), unit) for column, unit in units)
    return {channel: SensorRange(limit, unit) for channel, limit, unit in limits if limit is not None}


def without_commanded(rig: "Rig | None", recording: Recording, found: Iterable[Finding]) -> list[Finding]:
    """Findings less those of a flat signal in commands and triggers: these may rest and hold."""
    called = {c.channel for c in (() if rig is None else rig.columns()) if c.commanded or not c.level}
    names = {c.name for g in recording.groups for c in g.channels if not called.isdisjoint(c.names)}
    return [f for f in found if not (f.channel in names and f.code in _FLAT)]


TIME_UNITS = {"ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1.0 / 60.0}
"""Units of a time that may have been taken for seconds, each by how many there are in one."""


def rate_findings(rig: "Rig | None", groups: Iterable[GroupCheck]) -> list[Finding]:
    """Rates of the logs that are not those which the rig states for their loggers, and logs too short for any."""
    found: list[Finding] = []
    if rig is None:
        return found
    for check in groups:
        names = {name for channel in check.group.channels for name in channel.names}
        for name, logger in rig.loggers.items():
            if 0 < check.samples < FEWEST_SAMPLES and any(column.channel in names for column in rig.columns(name)):
                message = f"loggers.{name}: {check.samples} samples in the log, expected the whole run: nothing of "
                message += "these sensors can be analysed; export the log again, or repeat the run"
                found.append(Finding("few_samples", None, None, message))
            stated = logger.rate if "rate" in logger.model_fields_set else None
            if stated is None or check.rate_hz is None or abs(check.rate_hz / stated - 1.0) <= RATE_TOLERANCE:
                continue
            if any(column.channel in names for column in rig.columns(name)):
                message = (
                    f"loggers.{name}: rate {stated:g} Hz in the rig, {check.rate_hz:.6g} Hz in the log, which is taken"
                )
                units = [
                    unit for unit, factor in TIME_UNITS.items() if abs(check.rate_hz * factor / stated - 1.0) < 0.1
                ]
                if units:
                    message += f"; its time seems to be in {units[0]}: name that unit in the log or its description"
                found.append(Finding("rate_contradicts_rig", None, None, message))
    return found


def unclocked(rig: "Rig", recordings: Iterable[Recording]) -> list[Finding]:
    """Loggers of the rig whose logs hold no time, by their headers."""
    found: list[Finding] = []
    for group in (group for recording in recordings for group in recording.groups):
        names = {name for channel in group.channels for name in channel.names}
        loggers = dict.fromkeys(column.logger for column in rig.columns() if column.channel in names)
        found += [replace(f, message=f"loggers.{one}: {f.message}") for one in loggers for f in clock_findings(group)]
    return found


def of_conditions(rig: "Rig", conditions: Mapping[str, Any]) -> list[Finding]:
    """Counter-masses and payloads that the run table puts on sites which the rig's mechanism does not have."""
    if rig.names is None:
        return []
    wrong = [("counter_masses", rig.names.unknown("site", site)) for site in conditions.get("counter_masses", {})]
    for name in conditions.get("payloads", {}):
        if name not in rig.names.bodies:
            wrong.append((f"payload_{name}_kg", rig.names.unknown("body or site", name)))
    return [Finding("unknown_site", None, None, f"the run table's {key}: {text}") for key, text in wrong if text]


def rig_findings(
    rig: "Rig",
    recordings: Iterable[Recording],
    sibling_log: Callable[[Collection[str]], str | None] = lambda channels: None,
) -> list[Finding]:
    """Where the rig and the logs of one run differ. A logger of which the run holds no channel is not in the run.

    A rig describes a whole bench: what any log of the run holds is recorded, and what none holds is said, with the
    logs that were looked at. ``sibling_log`` names a log outside the run that holds one of these channels.
    """
    recordings = list(recordings)
    groups = [group for recording in recordings for group in recording.groups]
    channels = {name: g.channels[at[-1]] for g in groups for name, at in by_name(g.channels).items()}
    labels = list(dict.fromkeys(c.label for c in channels.values()))
    known = {column.channel for column in rig.columns()}
    strange = [one for one in recordings if known.isdisjoint(by_name(c for g in one.groups for c in g.channels))]
    found: list[Finding] = []
    absent: list[Finding] = []
    for logger in rig.loggers:
        columns = list(rig.columns(logger))
        present = [column for column in columns if column.channel in channels]
        if present:
            found += [_missing(column, labels) for column in columns if column.channel not in channels]
        elif columns:
            other = sibling_log({column.channel for column in columns})
            absent.append(
                _absent(logger, columns, recordings, strange) if other is None else _apart(logger, columns, other)
            )
        found += _units(present, channels)
    found += _of_several(rig.columns(), groups)
    found += _logged_twice({column.channel: column.logger for column in rig.columns()}, recordings)
    found += _taken_twice([column for column in rig.columns() if column.channel in channels], channels)
    if len(absent) == sum(any(rig.columns(logger)) for logger in rig.loggers):
        message = (
            f"none of the rig's channels ({first_of((c.channel for c in rig.columns()), 4)}) is in the log: "
            f"{_names(strange)}; name them in the rig (sensors.NAME.channel)"
        )
        return [*found, Finding(_CODE, None, None, message)]
    return found + absent


def _of_several(columns: "Iterable[Column]", groups: Iterable[Group]) -> list[Finding]:
    """Channels that the rig calls by what several of one group are called: nobody knows which is the sensor's."""
    named = [(group, by_name(group.channels)) for group in groups]
    return [
        Finding(
            _CODE, column.channel, None,
            f"the rig names it in sensors.{column.sensor}, and {of_one_name(group.channels, places)}",
        )
        for column in columns
        for group, known in named
        if len(places := known.get(column.channel, [])) > 1
    ]  # fmt: skip


def _logged_twice(loggers: Mapping[str, str], recordings: "Sequence[Recording]") -> list[Finding]:
    """Logs of the run that hold the same of the rig's channels, which its ``loggers`` record.

    Of logs that hold others, too, one may hold what another logger's channel is called: only who reads that needs one.
    """
    logs: dict[frozenset[str], list[str]] = {}
    for recording in recordings:
        held = frozenset(loggers.keys() & {name for g in recording.groups for c in g.channels for name in c.names})
        logs.setdefault(held, []).append(recording.path.name)
    return [
        Finding(
            "logger_twice",
            None,
            None,
            f"{' and '.join(names)} {'both' if len(names) == 2 else 'all'} hold {first_of(sorted(held), 4)} of logger "
            f"{first_of(sorted({loggers[name] for name in held}), 4)}: expected one log of a logger in a run; is the "
            "run's name used twice in the run table?",
        )
        for held, names in logs.items()
        if held and len(names) > 1
    ]


def _taken_twice(present: Iterable["Column"], channels: Mapping[str, Channel]) -> list[Finding]:
    """Channels that the rig calls by two names, with the unit and without."""
    called: dict[int, str] = {}
    return [
        Finding(_CODE, column.channel, None, f"the rig calls this channel {other!r} too: expected one sensor a channel")
        for column in present
        if (other := called.setdefault(id(channels[column.channel]), column.channel)) != column.channel
    ]


def _missing(column: "Column", labels: Sequence[str]) -> Finding:
    message = (
        f"the rig names it in sensors.{column.sensor} (logger {column.logger}); the log holds {first_of(labels, 12)}"
        f"{suggestion(column.channel, labels)}"
    )
    return Finding(_CODE, column.channel, None, message)


def _absent(
    logger: str, columns: "Sequence[Column]", logs: Sequence[Recording], strange: Sequence[Recording]
) -> Finding:
    """Of a logger that no log of the run holds; ``strange`` logs hold no channel of the rig, and so perhaps its own."""
    names = ", ".join(dict.fromkeys(column.sensor for column in columns))
    own = logs[0].path.name if len(logs) == 1 else f"any of {first_of((one.path.name for one in logs), 12)}"
    labels = dict.fromkeys(c.label for one in strange or logs for g in one.groups for c in g.channels)
    text = f"is in {own}, of which the run is made; a log that holds them is joined to the run by a run table (--runs)"
    if strange:
        called = first_of((repr(column.channel) for column in columns), 12)
        text = f"({called}) is in a log; {_names(strange)}: write these names into the rig, sensors.NAME.channel"
    near = next(filter(None, (suggestion(column.channel, labels) for column in columns)), "")
    message = f"nothing is recorded of sensors {names} (logger {logger}): no channel of theirs {text}{near}"
    return Finding("sensor_not_recorded", None, None, message)


def _names(recordings: Iterable[Recording]) -> str:
    """What is in logs, those of the same channels together."""
    logs: dict[str, list[str]] = {}
    for one in recordings:
        labels = dict.fromkeys(c.label for g in one.groups for c in g.channels)
        logs.setdefault(first_of(map(repr, labels), 12), []).append(one.path.name)
    return "; ".join(f"{first_of(names, 1)} holds {labels}" for labels, names in [*logs.items()][:4])


def _apart(logger: str, columns: "Iterable[Column]", other: str) -> Finding:
    names = ", ".join(dict.fromkeys(column.sensor for column in columns))
    message = (
        f"sensors {names} (logger {logger}) are in {other}, a run of its own; where both are of one test, as "
        "`testbench align` takes them, a run table (--runs) joins them"
    )
    return Finding("sensor_elsewhere", None, None, message)


def _units(present: "Iterable[Column]", channels: Mapping[str, Channel]) -> list[Finding]:
    """Units that the rig and the log give, and where a calibration leads from there."""
    found: list[Finding] = []
    calibrated = set()
    for column in present:
        if column.calibration is None:
            found += _unit(column, channels[column.channel])
        elif column.sensor not in calibrated and all(s.channel in channels for s in column.siblings):
            calibrated.add(column.sensor)
            found += _calibrated(column, channels)
    return found


def _calibrated(column: "Column", channels: Mapping[str, Channel]) -> list[Finding]:
    from balance.errors import UnitError

    from ..calibration.definition import unit_of_log
    from ..calibration.evaluation import bind_sensor

    assert column.calibration is not None
    try:
        bind_sensor(column.calibration, column.siblings, [channels[s.channel].unit for s in column.siblings])
    except UnitError as error:
        message = f"sensors.{column.sensor}.calibration: {error}"
        if any(unit_of_log(channels[s.channel].unit, "stated") != channels[s.channel].unit for s in column.siblings):
            message += f': state which it is in the rig, as unit of sensors.{column.sensor}, such as unit = "counts"'
        return [Finding("calibration_contradiction", channels[column.channel].name, None, message)]
    return []


def _unit(column: "Column", channel: Channel) -> list[Finding]:
    """The unit that the rig states against the one that the log writes, and both against what is measured."""
    from ..calibration.definition import is_electrical, unit_of_log

    written = unit_of_log(channel.unit, column.unit if column.stated else None)
    if written and column.unit and column.stated and not same_unit(written, column.unit):
        message = f"sensors.{column.sensor}: unit {column.unit!r} in the rig, {written!r} in the log"
        return [Finding(_CODE, channel.name, None, message)]
    unit = written or column.unit
    if not unit or not column.level or _measures(unit, column.dimensions):
        return []

    if is_electrical(unit):
        message = f"is in {unit!r}, and sensors.{column.sensor} has no calibration: testbench calibrate adds one"
        return [Finding("uncalibrated", channel.name, None, message)]
    from balance.units import SI_UNITS  # late: most logs are read without it

    message = (
        f"sensors.{column.sensor}: {unit!r} in the log is no {' or '.join(column.dimensions)}: expected a unit such "
    )
    message += f"as {' or '.join(SI_UNITS[one] for one in column.dimensions)}"
    if unit_of_log(unit, "stated") is None:
        message += f"; nobody knows this unit: state which it is in the rig, as unit of sensors.{column.sensor}"
    return [Finding(_CODE, channel.name, None, message)]


def _measures(unit: str, dimensions: tuple[str, ...]) -> bool:
    from balance.errors import UnitError
    from balance.units import factor_to_si

    try:
        factor_to_si(unit, *dimensions)
    except UnitError:
        return False
    return True


def duration_findings(checks: Iterable[GroupCheck], measured: Collection[str], motion: Motion) -> list[Finding]:
    """Groups with one of the channels ``measured``, or any where none is named, that last too short for the motion."""
    found = []
    for check in checks if motion is not None else ():
        named, lasts = {name for channel in check.group.channels for name in channel.names}, _lasts(check)
        if lasts is None or motion is None or (measured and named.isdisjoint(measured)):
            continue
        if lasts < LEAST_SHARE * motion[1]:
            message = (
                f"lasts {lasts:.4g} s, and {motion[0]}, which the run table names, {motion[1]:.4g} s: is its time in "
                "the unit that it states? State time and the right time_unit in an import description (--as), or "
                "repeat the run"
            )
            found.append(Finding("duration_contradiction", None, None, message, check.group.name))
    return found


def with_units_confirmed(
    found: Iterable[Finding], checks: Sequence[GroupCheck], rig: "Rig | None", motion: Motion
) -> list[Finding]:
    """The findings, of which times without a unit are notes where the rig, another logger or the motion shows it."""
    by_group = {check.group.name: check for check in checks}
    return [
        _confirmed(f, by_group[f.group], checks, rig, motion)
        if f.code == "time_unit_assumed" and f.group in by_group
        else f
        for f in found
    ]


def _confirmed(
    found: Finding, check: GroupCheck, checks: Sequence[GroupCheck], rig: "Rig | None", motion: Motion
) -> Finding:
    named = {name for channel in check.group.channels for name in channel.names}
    for name, logger in [] if rig is None else rig.loggers.items():
        held = rig is not None and any(column.channel in named for column in rig.columns(name))
        if held and "rate" in logger.model_fields_set:
            told = unit_assumed(found.channel or "", check.rate_hz, logger.rate, f"loggers.{name} of the rig")
            if told.code != found.code:
                return replace(told, group=found.group)
    if (lasts := _lasts(check)) is None:
        return found
    others = {f"group {one.group.name!r}": (other, OF_ONE_RUN) for one in checks if (other := _known(one)) is not None}
    others |= {} if motion is None else {motion[0]: (motion[1], IN_SECONDS)}
    for what, (other, (least, most)) in others.items():
        if least <= lasts / other <= most:
            message = f"carries no unit: seconds, in which it lasts {lasts:.4g} s, and {what} {other:.4g} s"
            return replace(found, code="time_unit_confirmed", message=message)
    if motion is not None and not NOT_IN_SECONDS[0] < lasts / motion[1] < NOT_IN_SECONDS[1]:
        message = (
            f"carries no unit; in seconds it lasts {lasts:.4g} s, and {motion[0]}, which the run table names, "
            f"{motion[1]:.4g} s: state time and time_unit in an import description (testbench describe LOG; --as)"
        )
        return replace(found, code="time_unit_contradiction", message=message)
    return found


def _lasts(check: GroupCheck) -> float | None:
    """How long a group lasts [s]; None without a rate."""
    return None if check.rate_hz is None or check.samples < 2 else check.samples / check.rate_hz


def _known(check: GroupCheck) -> float | None:
    """The same, where the unit of its time is known."""
    clock = check.group.clock
    return None if isinstance(clock, TimeColumn) and clock.assumed else _lasts(check)
