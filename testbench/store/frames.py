"""A group of a stored run in pandas or xarray, with names and units; only the channels that are asked for are read."""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..recording import Samples
from . import layout

if TYPE_CHECKING:
    import pandas
    import xarray

    from .run import Run, StoredGroup


def to_pandas(run: "Run", group: str | None, channels: Sequence[str] | None) -> "pandas.DataFrame":
    """Channels as written by name, against time [s], or sample where there is no time; units in ``attrs``."""
    import pandas

    where = run.group(group)
    indices = _asked(run, where, channels)
    units = {where.channels[i].name: where.channels[i].unit for i in indices}
    kind, index = _index(run, where)
    axis = pandas.Index(index, name="time (s)" if kind == layout.TIME else kind, copy=False)
    columns = [run.channel_at(where.name, i) for i in indices]
    frame = pandas.DataFrame(dict(enumerate(columns)), index=axis, copy=False)
    frame.columns = pandas.Index([where.channels[i].name for i in indices])
    frame.attrs.update({**_about(run, where), "units": units})
    return frame


def to_xarray(run: "Run", group: str | None, channels: Sequence[str] | None) -> "xarray.Dataset":
    """Channels by their HDF5 name against time [s], with ``units`` and ``long_name``, as `open_dataset` gives them.

    A time column is the axis, in seconds, and no channel beside it, also where it is asked for.
    """
    import xarray

    where = run.group(group)
    kind, index = _index(run, where)
    found = {
        where.keys[i]: (kind, run.channel_at(where.name, i), _attributes(where, i))
        for i in _asked(run, where, channels)
        if where.keys[i] != kind
    }
    axis = {kind: (kind, index, {"units": "s"} if kind == layout.TIME else {})}
    return xarray.Dataset(found, axis, _about(run, where))


def _about(run: "Run", group: "StoredGroup") -> dict[str, Any]:
    """Where the values are from, and by which calibrations they are in SI, a JSON text: netCDF holds no tables."""
    about = {"run": run.name, "group": group.name, "origin": run.origin}
    held = run.provenance.get("calibrations")
    return about if held is None else {**about, "calibrations": json.dumps(held, ensure_ascii=False)}


def _asked(run: "Run", group: "StoredGroup", channels: Sequence[str] | None) -> list[int]:
    """Indices of the channels that are asked for; without any, all but the time."""
    if channels is not None:
        return [run.find(name, group.name)[1] for name in channels]
    return list(group.measured)


def _index(run: "Run", group: "StoredGroup") -> tuple[str, Samples]:
    if group.has_time:
        return layout.TIME, run.time(group.name)
    return layout.SAMPLE, np.arange(group.samples, dtype=np.float64)


def _attributes(group: "StoredGroup", index: int) -> dict[str, Any]:
    channel = group.channels[index]
    return {"long_name": channel.name, **({} if channel.unit is None else {"units": channel.unit})}
