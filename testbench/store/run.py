"""A stored run, read back: names, units, time, conditions, findings."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import numpy as np

from balance.results import Key, Shown

from ..errors import StoreError
from ..recording import (
    Channel,
    Conditions,
    Finding,
    Group,
    Origin,
    Samples,
    StartTime,
    TextSeries,
    TimeColumn,
    UniformClock,
    by_name,
    clock_from_dict,
    earliest,
    of_one_name,
)
from . import atomic_files, encodings, layout, safe_hdf5
from .chunk_io import Digests, digests_from
from .encodings import Decimals

if TYPE_CHECKING:
    import h5py
    import pandas
    import xarray

ARCHIVED_FROM = "archived_from"
"""Key of the provenance of an archived run."""
_SIGNS = 8
"""Signs of zeros in a byte."""


@dataclass(frozen=True)
class StoredGroup(Group):
    """A group of a stored run: its samples, its rate [Hz] and where that came from, its place in the file."""

    samples: Annotated[int, Key()] = 0
    rate_hz: Annotated[float | None, Key()] = None
    rate_source: Annotated[str | None, Key()] = None
    start_time: Annotated[StartTime | None, Key()] = None
    path: str = ""
    keys: tuple[str, ...] = ()
    whole: tuple[Decimals | None, ...] = ()
    """How each channel is kept as whole numbers, if it is."""
    digests: Digests | None = field(default=None, repr=False)
    """What its samples must be; None of a run that was stored before there were digests."""

    @property
    def has_time(self) -> bool:
        """Whether its samples have a time in seconds: a rate, or a recorded column whose unit is known."""
        clock = self.clock
        return clock.seconds_per_unit is not None if isinstance(clock, TimeColumn) else clock is not None

    @property
    def measured(self) -> tuple[int, ...]:
        """Indices of the channels besides the time: of all where that is in no unit of time."""
        time = self.clock.index if isinstance(self.clock, TimeColumn) and self.has_time else None
        return tuple(i for i in range(len(self.channels)) if i != time)

    def places(self, index: int) -> tuple[str, ...]:
        """Where a channel lies in the file: its samples, and the signs of its zeros where these are stored as well."""
        path, form = f"{self.path}/{self.keys[index]}", self.whole[index] if self.whole else None
        signs = form is not None and form.negative_zeros
        return (path, path.replace(layout.ENTRY, layout.MINUS, 1)) if signs else (path,)

    def samples_of(
        self, file: "h5py.File", index: int, begin: int = 0, end: int | None = None, node: "h5py.Group | None" = None
    ) -> Samples:
        """The values of a channel as recorded, from sample ``begin`` to ``end``; ``node`` is the group in the file.

        Whole blocks are read. Raises StoreError where one is not as written: damaged, a hole, or of another place.
        """
        end = self.samples if end is None else min(end, self.samples)
        block = self.digests.block if self.digests else _SIGNS
        first, last = begin // block * block, min(-(-end // block) * block, self.samples)

        def check(at: int, values: Samples) -> None:
            if self.digests:
                name = f"{Path(file.filename).name}: group {self.name!r}, channel {self.channels[index].name!r}"
                self.digests.check(index, at, values, name)

        path, *signs = self.places(index)
        form = self.whole[index] if self.whole else None
        if form is None:
            place = (file, path) if node is None else (node, self.keys[index])
            values = safe_hdf5.numbers(*place, first, last, block if self.digests else 0, check)
        else:
            stored = safe_hdf5.whole_numbers(file, path, form.kind, first, last)
            bits = first // _SIGNS, first // _SIGNS - (-len(stored) // _SIGNS)
            minus = safe_hdf5.whole_numbers(file, signs[0], "u1", *bits) if signs else None
            values = form.restored(stored, minus)
            check(first, values)
        return values[begin - first : end - first]

    def index(self, name: str) -> int | None:
        """The channel of this name as written; else of this name without its unit; else of this HDF5 name.

        None where there is none, or not only one.
        """
        found = self.indices(name)
        return found[0] if len(found) == 1 else None

    def indices(self, name: str) -> list[int]:
        """All channels of this name, by which :meth:`index` goes."""
        return self._indices_by_name.get(name, [])

    @cached_property
    def _indices_by_name(self) -> dict[str, list[int]]:
        return {key: [k] for k, key in enumerate(self.keys)} | by_name(self.channels)

    def attributes(self, index: int) -> dict[str, str]:
        """``long_name`` and, where the log has one, ``units`` of a channel, as xarray and netCDF name them."""
        channel = self.channels[index]
        return {"long_name": channel.name, **({} if channel.unit is None else {"units": channel.unit})}


@dataclass(frozen=True)
class Run(Shown, rows="groups", figure="testbench.figures.runs:draw_run"):
    """One stored run. The file is opened for each read only, so nothing need be closed.

    >>> import testbench
    >>> run = testbench.open_run("campaign/r001.h5")
    >>> run.table()["rate_hz"].round(1).tolist()
    [5000.0, 2000.0, 1000.0]
    """

    path: Annotated[Path, Key("file", to=lambda path: path.name)]
    groups: Annotated[tuple[StoredGroup, ...], Key()]
    origin: Annotated[Origin, Key()]
    conditions: Annotated[Conditions, Key()]
    rig: str | None
    findings: Annotated[tuple[Finding, ...], Key()]
    provenance: dict[str, Any]
    inputs: Mapping[str, tuple[str, ...]] = field(default_factory=dict, kw_only=True)
    """What the run was made with, by ``mechanism`` and ``motion``: name of the file, its text, that of its samples.

    One that was not found when the run was stored is absent.
    """

    @property
    def sources(self) -> Annotated[list[str], Key()]:
        """Names of the logs."""
        return [source["name"] for source in self.provenance["sources"]]

    @property
    def name(self) -> Annotated[str, Key("run")]:
        """The run's name: that of its file without ending."""
        return self.path.stem

    @property
    def texts(self) -> list[TextSeries]:
        """Channels of text beside the numbers: each text with the sample of its group from which on it stands."""
        return [TextSeries(**series) for source in self.provenance["sources"] for series in source.get("texts", ())]

    @property
    def start_time(self) -> Annotated[StartTime | None, Key()]:
        """When its first sample was taken, of those groups whose logs say it; with a zone if any of them has one."""
        return earliest(group.start_time for group in self.groups)

    def group(self, name: str | None = None) -> StoredGroup:
        """The group of this name; the only one if no name is given."""
        if name is None and len(self.groups) == 1:
            return self.groups[0]
        for group in self.groups:
            if group.name == name:
                return group
        wanted = (
            f"no group {name!r}" if name is not None else "has several groups: name one, or join them: resample='1 kHz'"
        )
        raise StoreError(f"{self.path.name}: {wanted}; there are {_listed(g.name for g in self.groups)}")

    @property
    def rate_hz(self) -> float | None:
        """Sampling rate of the only group [Hz]: declared, or 1 / median step; None if there is none."""
        return self.group().rate_hz

    def find(self, channel: str, group: str | None = None) -> tuple[StoredGroup, int]:
        """Where a channel is: its group and its index there. It must be in one group only."""
        among = self.groups if group is None else (self.group(group),)
        found = [(g, i) for g in among if (i := g.index(channel)) is not None]
        if len(found) == 1:
            return found[0]
        if found:
            groups = _listed(g.name for g, _ in found)
            raise StoreError(
                f"{self.path.name}: channel {channel!r} is in several groups, {groups}: name one, or rename it in the "
                "other's log by an import description (channels) and ingest into another folder"
            )
        for one in among:
            if places := one.indices(channel):
                several = f"channel {channel!r} is not one in group {one.name!r}: {of_one_name(one.channels, places)}"
                raise StoreError(f"{self.path.name}: {several}, and ingest into another folder")
        known = _listed(c.name for g in among for c in g.channels)
        raise StoreError(f"{self.path.name}: no channel {channel!r}; there are {known}")

    def channel(self, name: str, group: str | None = None) -> Samples:
        """The values of a channel as recorded, in its unit as written, (n,)."""
        return self.channels_at([self.find(name, group)])[0]

    def channel_at(self, group: str, index: int) -> Samples:
        """The values of the channel of this index in its group, whatever its name, (n,)."""
        return self.channels_at([(self.group(group), index)])[0]

    def channels_at(
        self, places: Sequence[tuple[StoredGroup, int]], begin: int = 0, end: int | None = None
    ) -> list[Samples]:
        """The values of channels as recorded, (n,) each, by group and index, from sample ``begin`` to ``end``.

        Read in one opening of the file.
        """
        with safe_hdf5.open_for_reading(self.path) as file:
            if len(places) == 1:
                return [group.samples_of(file, index, begin, end) for group, index in places]
            nodes = {group.path: safe_hdf5.member(file, group.path) for group, _ in places}
            return [group.samples_of(file, index, begin, end, nodes[group.path]) for group, index in places]

    def to_pandas(
        self, group: str | None = None, channels: Sequence[str] | None = None, resample: float | str | None = None
    ) -> "pandas.DataFrame":
        """A group as a table against time [s], or sample where there is no time; of ``channels`` alone if given.

        Columns are the channels by name as written; units are in ``.attrs["units"]``. Without a ``group``, the tables
        of several groups stand below each other, ``table.loc["daq"]`` one of them, each on its own logger's clock; a
        channel that a group does not have is NaN there. Raises StoreError where one name has several channels or units.

        With ``resample``, a rate [Hz, or a text such as ``1 kHz``], all groups are one table on one clock; ``.attrs``
        states how they were resampled.
        """
        import pandas

        if resample is not None:
            if group is not None:
                raise StoreError(
                    f"{self.path.name}: resample joins all groups: expected channels, found group {group!r}"
                )
            of_all = import_module("testbench.runs.joined_channels")  # higher up: it knows the clocks' alignments
            joined: pandas.DataFrame = of_all.joined(self, resample, channels)
            return joined
        if group is None and len(self.groups) > 1 and channels is None:
            return self._groups_below_each_other()
        where = self.group(group)
        indices = self._selected(where, channels)
        kind, index = self._index(where)
        axis = pandas.Index(index, name="time (s)" if kind == layout.TIME else kind, copy=False)
        columns = [self.channel_at(where.name, i) for i in indices]
        frame = pandas.DataFrame(dict(enumerate(columns)), index=axis, copy=False)
        frame.columns = pandas.Index([where.channels[i].name for i in indices])
        units = {where.channels[i].name: where.channels[i].unit for i in indices}
        frame.attrs.update({**self._about(where), "units": units})
        return frame

    def _groups_below_each_other(self) -> "pandas.DataFrame":
        import pandas

        each = {one.name: self.to_pandas(one.name) for one in self.groups}
        units: dict[str, str | None] = {}
        for one in each.values():
            own = one.attrs.pop("units")
            if len(own) < one.shape[1] or any(units.get(name, unit) != unit for name, unit in own.items()):
                raise StoreError(
                    f"{self.path.name}: a name has several channels or units: name a group, there are "
                    f"{_listed(g.name for g in self.groups)}"
                )
            units |= own
        together = pandas.concat(each, names=["group", "time (s) or sample"])
        together.attrs.update({**self._about(None), "units": units})
        return together

    def spectra(self, channels: Sequence[str] = (), segment: int = 4096) -> "pandas.DataFrame":
        """Power spectral densities of channels that the run's rig names, in SI by the calibration in force.

        A row a frequency [Hz], a column a channel, named by sensor and component (``"base_acc x"``); in ``channels``
        also as the rig names it (``"AccX"``). One-sided, by Welch over the whole record: Hann window, half overlap,
        the mean of each segment removed. ``segment`` [samples, even]: shorter where the record has no two of it.
        ``.attrs`` has ``units``, ``resolution_hz`` and number of ``segments`` by channel. Channels of another rate have
        lines of their own: NaN between them, and throughout where the record is too short. Raises AnalysisError without
        a rig.

        >>> import testbench
        >>> found = testbench.open_run("campaign/r001.h5").spectra(["base_acc x"])
        >>> found.attrs["units"], found.attrs["resolution_hz"]
        ({'base_acc x': '(m/s^2)^2/Hz'}, {'base_acc x': 2.44140625})
        >>> round((found["base_acc x"].sum() * found.index[1]) ** 0.5, 2)  # RMS [m/s2]
        np.float64(0.39)
        """
        higher = import_module("testbench.runs.si_run"), import_module("testbench.vibration.channel_levels")
        found: pandas.DataFrame = higher[1].spectra(higher[0].SIRun.of(self), channels, segment)
        return found

    def to_xarray(
        self, group: str | None = None, channels: Sequence[str] | None = None, resample: float | str | None = None
    ) -> "xarray.Dataset":
        """A group as a dataset against time [s], as `open_dataset` gives it: HDF5 names, ``units``, ``long_name``.

        A time column is the axis, in seconds, and no channel too, also where it is asked for. With ``resample`` all
        groups on one clock, as :meth:`to_pandas` has them.
        """
        try:
            import xarray
        except ImportError as error:
            raise StoreError(
                "a dataset needs xarray: pip install 'counterpoise[xarray]'; to_pandas needs nothing"
            ) from error
        if resample is not None:
            table, taken = self.to_pandas(group, channels, resample), {layout.TIME}
            units = table.attrs.pop("units")
            joined = {
                layout.safe_name(name, taken): (layout.TIME, table[name], {"units": unit or "", "long_name": name})
                for name, unit in units.items()
            }
            return xarray.Dataset(joined, {layout.TIME: (layout.TIME, table.index, {"units": "s"})}, table.attrs)
        where = self.group(group)
        kind, index = self._index(where)
        found = {
            where.keys[i]: (kind, self.channel_at(where.name, i), where.attributes(i))
            for i in self._selected(where, channels)
            if where.keys[i] != kind
        }
        axis = {kind: (kind, index, {"units": "s"} if kind == layout.TIME else {})}
        return xarray.Dataset(found, axis, self._about(where))

    def _about(self, group: StoredGroup | None) -> dict[str, Any]:
        """Where the values are from, and by which calibrations in SI, a JSON text: netCDF holds no tables."""
        about = {"run": self.name, **({} if group is None else {"group": group.name}), "origin": self.origin}
        about |= {key: value for key, value in self.provenance.items() if key == "g0_m_per_s2"}
        applied = self.provenance.get("calibrations")
        return about if applied is None else {**about, "calibrations": json.dumps(applied, ensure_ascii=False)}

    def _selected(self, group: StoredGroup, channels: Sequence[str] | None) -> list[int]:
        """Indices of the channels that are asked for; without any, all but the time."""
        if channels is not None:
            return [self.find(name, group.name)[1] for name in channels]
        return list(group.measured)

    def _index(self, group: StoredGroup) -> tuple[str, Samples]:
        if group.has_time:
            return layout.TIME, self.time(group.name)
        return layout.SAMPLE, np.arange(group.samples, dtype=np.float64)

    def time(self, group: str | None = None, begin: int = 0, end: int | None = None) -> Samples:
        """Time of each sample, or of those from ``begin`` to ``end``, on its logger's own clock, (n,) [s]."""
        where = self.group(group)
        if isinstance(where.clock, UniformClock):
            return where.clock.times(begin, where.samples if end is None else min(end, where.samples))
        if where.clock is None or where.clock.seconds_per_unit is None:
            raise StoreError(
                f"{self.path.name}: group {where.name!r} has no time column in a unit of time, and no rate"
            )
        (recorded,) = self.channels_at([(where, where.clock.index)], begin, end)
        return recorded if where.clock.seconds_per_unit == 1.0 else recorded * where.clock.seconds_per_unit


def open_run(path: str | Path) -> Run:
    """Open a stored run; its data are read when asked for. Raises StoreError for a file that is none.

    >>> import testbench
    >>> testbench.open_run("campaign/r001.h5").conditions["payload_kg"]
    3.4116
    """
    path = Path(path)
    with safe_hdf5.open_for_reading(path) as file:
        known = layout.read_description(file)
        digests = known.get("digests")
        texts = {place: layout.read_texts(file, place, digests) for place in layout.TEXTS}
        return Run(
            path=path,
            groups=tuple(_group(file, group, n, digests) for n, group in enumerate(known["groups"])),
            origin=cast(Origin, known["origin"]),
            conditions=cast(Conditions, known["conditions"]),
            rig=texts[layout.RIG][0] if texts[layout.RIG] else None,
            findings=tuple(Finding(**json.loads(text)) for text in texts[layout.FINDINGS]),
            provenance=dict(known["provenance"]),
            inputs={
                place.rpartition("/")[2]: tuple(texts[place])
                for place in (layout.MECHANISM, layout.MOTION)
                if texts[place]
            },
        )


def identities(run: Path) -> frozenset[str]:
    """SHA-256 of a stored run, and of the run that it is the archive of: records about one hold for the other."""
    own = atomic_files.recorded_digest(run)
    known = open_run(run).provenance.get(ARCHIVED_FROM)
    return frozenset({own, str(known["sha256"])} if isinstance(known, dict) and "sha256" in known else {own})


def _group(file: "h5py.File", known: Mapping[str, Any], number: int, digests: Any) -> StoredGroup:  # noqa: ANN401
    group = StoredGroup(
        name=str(known["name"]),
        channels=tuple(Channel(str(c["name"]), c["unit"], str(c["label"])) for c in known["channels"]),
        clock=clock_from_dict(known["clock"]),
        samples=int(known["samples"]),
        rate_hz=known["rate_hz"],
        rate_source=known["rate_source"],
        zero=known.get("zero") and StartTime(**known["zero"]),
        start_time=known.get("start_time") and StartTime(**known["start_time"]),
        path=f"{layout.ENTRY}/{known['key']}",
        keys=tuple(str(channel["key"]) for channel in known["channels"]),
        whole=tuple(encodings.from_dict(channel.get("whole")) for channel in known["channels"]),
        digests=digests_from(digests, number, known["channels"]),
    )
    node = safe_hdf5.member(file, group.path) if group.keys else file
    for key in group.keys:
        if (found := safe_hdf5.shape(node, key)) != (group.samples,):
            raise StoreError(f"{file.filename}: {group.path}/{key} holds {found}, expected {group.samples} samples")
    return group


def _listed(names: Any) -> str:  # noqa: ANN401
    return ", ".join(repr(str(name)) for name in names) or "none"
