"""How long logs last beside the motion of the run table, and what shows that a time without a unit is in seconds.

The next units of time, ms and min, are a thousand times smaller and sixty times larger: where the unit is wrong, a log
lasts as many times too long or too short.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from ..recording import Finding, TimeColumn
from .group_checks import GroupCheck, unit_assumed

if TYPE_CHECKING:
    from ..rig import Rig

LEAST_SHARE = 0.1
"""Of the motion's duration, below which a log does not hold that motion."""
IN_SECONDS = (0.5, 30.0)
"""Durations over that of the motion at which a time is in s: one in ms or min is so only where the log holds less than
6 % of the motion, or more than thirty of it."""
OF_ONE_RUN = (0.25, 4.0)
"""Durations over that of another logger of the run at which a time is in the unit of the other."""

Motion = tuple[str, float] | None
"""Name of the motion's file and its duration [s]; None where no motion is stored."""


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
    return found


def _lasts(check: GroupCheck) -> float | None:
    """How long a group lasts [s]; None without a rate."""
    return None if check.rate_hz is None or check.samples < 2 else check.samples / check.rate_hz


def _known(check: GroupCheck) -> float | None:
    """The same, where the unit of its time is known."""
    clock = check.group.clock
    return None if isinstance(clock, TimeColumn) and clock.assumed else _lasts(check)
