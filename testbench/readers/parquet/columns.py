"""Columns of a table as numbers: integers and floats as they are, points in time counted from a stated zero."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import polars

from ...recording import Channel, Samples, TimeColumn
from ...units import seconds_per
from ..csv.header import is_time_name, named_channels

_UNITS = {"ns": "ns", "us": "µs", "ms": "ms"}
_EXACT = 2.0**53


@dataclass(frozen=True)
class Column:
    """A column that is read: its name in the file, the channel that it becomes, and its numbers.

    ``zero`` is subtracted from what is counted in nanoseconds since 1970, which float64 does not hold.
    """

    name: str
    channel: Channel
    is_point_in_time: bool = False
    zero: int = 0

    def numbers(self, series: polars.Series) -> Samples:
        """The values as float64; NaN where there is none."""
        if series.dtype.is_temporal():
            series = series.to_physical()
        if self.zero:
            series = series.cast(polars.Int64) - self.zero
        return np.asarray(series.cast(polars.Float64).to_numpy(), dtype=np.float64)


def column(name: str, kind: polars.DataType, first: Callable[[str], int | None]) -> Column | None:
    """How a column is read; None if it holds no numbers. ``first`` gives a first value as an integer."""
    if isinstance(kind, polars.Datetime):
        unit = _UNITS[kind.time_unit]
        zero = first(name) or 0 if kind.time_unit == "ns" else 0
        return Column(name, Channel(name, unit), True, zero)
    if isinstance(kind, polars.Duration):
        return Column(name, Channel(name, _UNITS[kind.time_unit]))
    if isinstance(kind, polars.Time):
        return Column(name, Channel(name, "ns"))
    if isinstance(kind, polars.Date):
        return Column(name, Channel(name, "day"))
    if kind.is_numeric() or isinstance(kind, polars.Boolean):
        return Column(name, named_channels([name], [""])[0])
    return None


def is_wide(kind: polars.DataType) -> bool:
    """Whether integers of this type may be beyond what float64 holds."""
    return isinstance(kind, polars.Int64 | polars.UInt64 | polars.Int128)


def is_beyond_exact(series: polars.Series) -> bool:
    """Whether an integer is beyond what float64 holds."""
    return bool((series.cast(polars.Float64).abs() >= _EXACT).any())


def clock(columns: list[Column]) -> TimeColumn | None:
    """The column of time: named so, or else the only one of points in time."""
    named = [i for i, c in enumerate(columns) if is_time_name(c.channel.name)]
    points = [i for i, c in enumerate(columns) if c.is_point_in_time]
    found = named[:1] or (points if len(points) == 1 else [])
    if not found:
        return None
    unit = columns[found[0]].channel.unit
    return TimeColumn(found[0], 1.0 if unit is None else seconds_per(unit), assumed=unit is None)
