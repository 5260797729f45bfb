"""Runs drawn over a first one: their channels on its clock, and what they differ by, with an interval."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from balance.arrays import Floats
from balance.errors import CounterpoiseError, suggestion

from ..errors import AnalysisError
from ..figures import style
from ..runs.si_run import SIRun
from .page_contents import COMMAND, POSITIONS, columns_of, unit_of
from .traces import (
    Difference,
    Lag,
    Pairs,
    Trace,
    between_samples,
    channel_trace,
    difference,
    motion_begins,
    motion_lag,
    recorded_trace,
    shown_lag,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from ..store import Run

KEPT = 32
"""Runs, and differences, whose extremes are in memory."""


class RunTraces:
    """The channels of runs, and for two of them how much later the second shows the same."""

    def __init__(self, runs: "Sequence[Run]") -> None:
        self.by_name = {run.name: run for run in runs}
        self.unbound: dict[str, str] = {}
        """Runs whose channels are as recorded, and why."""
        if len(self.by_name) < len(runs):
            twice = next(name for name in self.by_name if sum(run.name == name for run in runs) > 1)
            raise AnalysisError(f"{twice}: of several campaigns, or given twice: expected runs of different names")

    @lru_cache(KEPT)  # noqa: B019 - as long as the program runs
    def of(self, name: str) -> dict[str, Trace]:
        """The channels of a run by name: those of its rig in SI, all others as recorded. Raises KeyError for no run."""
        run, found, known = self.by_name[name], dict[str, Trace](), set()
        if run.rig:
            try:
                si = SIRun.of(run)
                columns = list(columns_of(si))
            except CounterpoiseError as error:
                columns, self.unbound[name] = [], f"as recorded, without its rig: {error}"
            for kind, column in columns:
                try:
                    one = channel_trace(si, kind, f"{column.sensor} {column.component}", unit_of(si, column), column)
                except CounterpoiseError:  # no unit that it may have: as recorded
                    continue
                found[one.name] = one
                known.add((one.group, run.find(column.channel)[1]))
        for group in run.groups:
            for index in group.measured if group.has_time and group.samples else ():
                if (group.name, index) not in known:
                    one = recorded_trace(run, group, index)
                    found[one.name if one.name not in found else f"{group.name} {index}: {one.name}"] = one
        return found

    def _lag(self, one: Trace, other: Trace, first: str, second: str) -> Lag:
        """How much later the logger of a channel of the second run shows the same as that of it in the first."""
        return self._motion_lag(first, second, one.group, other.group) or self._shown_lag(one, other, first, second)

    @lru_cache(None)  # noqa: B019
    def _motion_lag(self, first: str, second: str, group: str, other: str) -> Lag | None:
        """By command and encoders."""
        both, shared = self._pairs(first, second, group, other)
        commands, encoders = ([p for p in both if {one.kind for one in p} == {kind}] for kind in (COMMAND, POSITIONS))
        return motion_lag(shared, commands, encoders)

    @lru_cache(None)  # noqa: B019
    def _shown_lag(self, one: Trace, other: Trace, first: str, second: str) -> Lag:
        """By a channel itself, else by others of its logger: of repeats alone."""
        _, shared = self._pairs(first, second, one.group, other.group)
        made = [{**self.by_name[run].conditions, "repeat": None} for run in (first, second)]
        repeats = len(made[0]) > 1 and made[0] == made[1]
        own = [(one, other), *(pair for pair in shared if pair[0] is not one)]
        return shown_lag(shared, own if repeats else [])

    def _pairs(self, first: str, second: str, group: str, other: str) -> tuple[Pairs, Pairs]:
        """The channels that both runs have, and of them those of one logger each."""
        others = self.of(second)
        both = [(one, others[name]) for name, one in self.of(first).items() if name in others]
        return both, [pair for pair in both if (pair[0].group, pair[1].group) == (group, other)]

    @lru_cache(None)  # noqa: B019
    def _moves(self, run: str, group: str) -> float | None:
        """When a logger of a run ceases to be at rest [s]."""
        return motion_begins([one for one in self.of(run).values() if one.group == group])

    @lru_cache(KEPT)  # noqa: B019
    def compared(self, first: str, second: str, channel: str) -> tuple[Lag, Difference | None]:
        """How much later the second run shows the same; a channel of it less that of the first, where both have it."""
        one, other = (self.of(run).get(channel) for run in (first, second))
        if one is None or other is None or one is other:
            return Lag(0.0, None, "nothing: the first run has no such channel"), None
        if one.unit != other.unit:
            raise AnalysisError(
                f"{channel}: in {one.unit} in {first}, in {other.unit} in {second}: state one in the rig"
            )
        late = self._lag(one, other, first, second)
        return late, difference(one, other, late, [self._moves(first, one.group), self._moves(second, other.group)])


@dataclass(frozen=True, repr=False)
class Overlay:
    """One channel of several runs at the instants of the first."""

    channel: str
    unit: str
    runs: "tuple[Run, ...]"
    time: Floats
    """On the clock of the first run's logger, (n,) [s]."""
    values: Floats
    """Of each run at those instants, interpolated but for the first, (runs, n) [unit]; NaN where none is."""
    lags: tuple[Lag, ...]
    """How much later each further run shows the same on its own clock, (runs - 1)."""
    differences: tuple[Difference, ...]
    """Of each further run less the first, (runs - 1), each with the half width of its interval of 95 %, if known."""

    @property
    def names(self) -> list[str]:
        """Of the runs."""
        return [run.name for run in self.runs]

    def table(self) -> "DataFrame":
        """The channel in each run, each further run less the first and, where it is known, the half width of its 95 %
        interval [unit], a row an instant; the index is the time of the first run's logger [s], as of ``Run.to_pandas``.
        """
        import pandas as pd

        first, *others = self.names
        columns = dict(zip(self.names, self.values, strict=True))
        for name, values, apart in zip(others, self.values[1:], self.differences, strict=True):
            columns[f"{name} less {first}"] = values - self.values[0]
            if apart.half_width is not None:
                columns[f"half width of {name} less {first}"] = apart.half_width.read(0, len(self.time))[1]
        found = pd.DataFrame(columns, index=pd.Index(self.time, name="time (s)"))
        found.attrs["units"] = dict.fromkeys(columns, self.unit)
        return found

    def __repr__(self) -> str:
        first, *others = self.names
        lines = []
        for name, late, apart in zip(others, self.lags, self.differences, strict=True):
            by = "" if late.deviation is None else f", aligned by {late.by}"
            lines.append(f"{self.channel}: {name} less {first}{by}: {apart.text}")
        return "\n".join(lines)

    def plot(self) -> "Figure":
        """The runs over each other, and below what each differs by from the first, its interval grey."""
        first, *others = self.names
        with style.styled():
            figure, panels = style.light_grid(2, 1, 2.2, sharex=True)
            above, below = panels[:, 0]
            for name, values in zip(self.names, self.values, strict=True):
                above.plot(self.time, values, lw=0.9, label=name)
            below.plot([], [])  # each difference has the colour of its run
            for values, found in zip(self.values[1:], self.differences, strict=True):
                (line,) = below.plot(self.time, values - self.values[0], lw=0.9)
                if found.half_width is not None:
                    apart, (_, half) = values - self.values[0], found.half_width.read(0, len(self.time))
                    below.fill_between(
                        self.time, apart - half, apart + half, color=line.get_color(), alpha=0.25, lw=0.0
                    )
            above.set_ylabel(f"{self.channel}\n[{self.unit}]")
            below.set_ylabel(f"less {first}\n[{self.unit}]")
            below.set_xlabel(f"time of the logger of {first} [s]")
            style.legend(figure, above)
            style.headline(figure, f"{style.origin_of(self.runs)}{self.channel}: {', '.join(others)} over {first}")
        return figure


def overlay(runs: "Sequence[Run]", channel: str) -> Overlay:
    """A channel of runs, by its name in the rig or in the log of the first, at the instants of the first.

    AnalysisError for fewer than two, or where one has no such.
    """
    if len(runs) < 2:
        raise AnalysisError(f"expected at least two runs to overlay, got {len(runs)}")
    traces = RunTraces(runs)
    first, *others = traces.by_name
    logged = {one.logged: name for name, one in traces.of(first).items()}
    channel = channel if channel in traces.of(first) else logged.get(channel, channel)
    for name in traces.by_name:
        if channel not in (known := traces.of(name)):
            raise AnalysisError(
                f"{name}: has no channel {channel!r}{suggestion(channel, [*known, *logged])}: {', '.join(known)}"
            )
    one = traces.of(first)[channel]
    time, values = one.read(0, one.samples)
    every, lags, differences = [values], [], []
    for name in others:
        late, found = traces.compared(first, name, channel)
        assert found is not None  # both have the channel, and they are not the same
        other = traces.of(name)[channel]
        every.append(between_samples(*other.read(0, other.samples), time + late.seconds))
        lags.append(late)
        differences.append(found)
    return Overlay(channel, one.unit, tuple(runs), time, np.array(every), tuple(lags), tuple(differences))
