"""A group of a run as columns of a table, time first where the clock is a rate; and as SEP005 of the SDyPy project.

SEP005 defines dictionaries in memory and no file; so do we.
https://github.com/sdypy/sdypy/blob/main/docs/seps/sep-0005.rst
"""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from balance.results import document

from ..recording import Channel, Samples, UniformClock
from ..store import Run
from ..store.ledger import read_ledger


@dataclass(frozen=True)
class Column:
    """One column: the channel, its place in the group (None: computed time), and its values when asked for."""

    channel: Channel
    run: Run
    group: str
    index: int | None

    @property
    def values(self) -> Samples:
        """The values as recorded, (n,)."""
        return self.run.time(self.group) if self.index is None else self.run.channel_at(self.group, self.index)

    @property
    def header(self) -> str:
        """The name as written, with the unit in brackets where the log has it in a row of its own."""
        channel = self.channel
        if channel.unit is None or channel.unit in channel.name.removeprefix(channel.label):
            return channel.name
        return f"{channel.label} ({channel.unit})"


def columns(run: Run, group: str) -> list[Column]:
    """The columns of a group; a uniform clock gives ``time (s)``, by index and rate."""
    where = run.group(group)
    found = [Column(channel, run, group, i) for i, channel in enumerate(where.channels)]
    if isinstance(where.clock, UniformClock):
        found.insert(0, Column(Channel("time (s)", "s", "time"), run, group, None))
    return found


def unique(headers: Sequence[str], longest: int | None = None) -> list[str]:
    """Headers of no more than ``longest`` characters, made different by a number where several are the same."""
    taken: dict[str, None] = {}
    for header in headers:
        name, n = header[:longest], 1
        while name in taken:
            n += 1
            end = f"_{n}"
            name = (header if longest is None else header[: longest - len(end)]) + end
        taken[name] = None
    return list(taken)


def unlisted_findings(run: Run, form: str) -> list[str]:
    """What a form without room for findings loses of a run."""
    count = sum(finding.severity > 0 for finding in run.findings)
    return [f"{count} findings about run {run.name!r}: not in {form}; parquet and mat hold them"] if count else []


def provenance(run: Run) -> dict[str, Any]:
    """What goes with the values wherever they go."""
    return {
        "run": run.name,
        "origin": run.origin,
        "conditions": dict(run.conditions),
        "start_times": {group.name: document(group.start_time) for group in run.groups if group.start_time},
        "findings": [finding.as_dict() for finding in run.findings],
        "provenance": run.provenance,
        "ledger_head": read_ledger(run.path.parent).head,
    }


def json_line(value: object) -> str:
    """``value`` as JSON on one line."""
    return json.dumps(value, ensure_ascii=False)


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
    counts = Counter(column.channel.name for column in found)
    names = [c.channel.name if counts[c.channel.name] == 1 else f"{c.group}: {c.channel.name}" for c in found]
    return [
        {
            "data": column.values,
            "name": name,
            "unit_str": column.channel.unit or "",
            "group": column.group,
            "origin": run.origin,
            **when[column.group],
        }
        for name, column in zip(unique(names), found, strict=True)
    ]
