"""SEP005 of the SDyPy project: time series as Python objects.

The proposal defines dictionaries in memory and no file; so do we.
"""

from typing import Any

from ..recording import UniformClock
from ..store import Run
from .columns import columns


def sep005(run: Run) -> list[dict[str, Any]]:
    """The channels of a run: ``data`` (n,), ``name``, ``unit_str``, and ``fs`` [Hz] or ``time`` (n,) [s].

    A channel without a unit has an empty ``unit_str``; groups without any clock are left out, for SEP005 needs one.
    """
    series = []
    for group in run.groups:
        clock = group.clock
        if clock is None or getattr(clock, "seconds_per_unit", 1.0) is None:
            continue
        uniform = isinstance(clock, UniformClock)
        when: dict[str, Any] = {"fs": clock.rate_hz} if isinstance(clock, UniformClock) else {}
        when = when if uniform else {"time": run.time(group.name)}
        for column in columns(run, group.name):
            if column.index is not None and column.index != getattr(clock, "index", None):
                unit = column.channel.unit or ""
                known = {"name": column.channel.name, "unit_str": unit, "group": group.name, "origin": run.origin}
                series.append({"data": column.values, **known, **when})
    return series
