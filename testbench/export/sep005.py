"""SEP005 of the SDyPy project: time series as Python objects.

The proposal defines dictionaries in memory and no file; so do we.
https://github.com/sdypy/sdypy/blob/main/docs/seps/sep-0005.rst
"""

from collections import Counter
from typing import Any

from ..recording import UniformClock
from ..store import Run
from .columns import Column, columns, unique


def sep005(run: Run) -> list[dict[str, Any]]:
    """The channels of a run: ``data`` (n,), ``name``, ``unit_str``, and ``fs`` [Hz] or ``time`` (n,) [s].

    Names are unique, as SEP005 wants them: that of the group goes before where several channels have one name. A
    uniform clock that does not begin at zero gives both ``fs`` and ``time``. A channel without a unit has an empty
    ``unit_str``; groups without a time in seconds are left out, for SEP005 needs one.
    """
    found: list[Column] = []
    when: dict[str, dict[str, Any]] = {}
    for group in run.groups:
        if not group.has_time:
            continue
        clock = group.clock
        when[group.name] = {"fs": clock.rate_hz} if isinstance(clock, UniformClock) else {}
        if not isinstance(clock, UniformClock) or clock.start_s != 0.0:
            when[group.name]["time"] = run.time(group.name)
        measured = set(group.measured)
        found += [column for column in columns(run, group.name) if column.index in measured]
    return [
        {
            "data": column.values,
            "name": name,
            "unit_str": column.channel.unit or "",
            "group": column.group,
            "origin": run.origin,
            **when[column.group],
        }
        for name, column in zip(_names(found), found, strict=True)
    ]


def _names(found: list[Column]) -> list[str]:
    counts = Counter(column.channel.name for column in found)
    return unique([c.channel.name if counts[c.channel.name] == 1 else f"{c.group}: {c.channel.name}" for c in found])
