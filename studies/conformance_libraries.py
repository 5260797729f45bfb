"""What the field's libraries give of a file: series of numbers and texts, with what each library knows of them."""

import logging
import re
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Series:
    """One channel; None: the library does not say. ``start_ns`` is that of its first sample, since 1970 [ns]."""

    name: str
    values: NDArray[Any] | list[str]
    unit: str | None = None
    rate_hz: float | None = None
    start_ns: int | None = None


@dataclass(frozen=True)
class Library:
    """A library, by its name, and how it reads a file.

    ``torn``: how many samples of a cut file may be the library's own making, such as a number whose last digits are
    lost; None where what it makes of a cut file is no measure: it ends the process, or spreads a block's samples.
    """

    name: str
    read: Callable[[Path], list[Series]]
    torn: int | None = 0


def _tdms(path: Path) -> list[Series]:
    import nptdms

    found = []
    for channel in (channel for group in nptdms.TdmsFile.read(path).groups() for channel in group.channels()):
        values, stated = channel[:], channel.properties
        if not len(values) or values.dtype.kind not in "iufbO":
            continue
        step, start = stated.get("wf_increment"), stated.get("wf_start_time")
        offset = round(1e9 * float(stated.get("wf_start_offset", 0)))
        unit = stated.get("unit_string") or stated.get("NI_UnitDescription")
        known = {"rate_hz": 1 / step if step else None, "unit": str(unit) if unit else None}
        if step and isinstance(start, np.datetime64) and start > np.datetime64("1971"):
            known["start_ns"] = int(start.astype("datetime64[ns]").astype(np.int64)) + offset
        found.append(_series(channel.name, values, **known))
    return found


def _uff(path: Path) -> list[Series]:
    import pyuff

    file, found = pyuff.UFF(str(path)), []
    for i, kind in enumerate(file.get_set_types()):
        if int(kind) == 58 and np.isrealobj((one := file.read_sets(i))["data"]):
            step = one.get("abscissa_inc") if one.get("abscissa_spacing") else None
            is_time = one.get("abscissa_spec_data_type") == 17
            unit = one.get("ordinate_axis_units_lab", "").strip()
            rate = 1 / step if step and is_time else None
            found.append(Series("", np.asarray(one["data"]), None if unit.upper() == "NONE" else unit or None, rate))
    return found


def _lvm(path: Path) -> list[Series]:
    import lvm_read

    found, file = [], lvm_read.read(str(path), read_from_pickle=False, dump_file=False)
    for i in range(file["Segments"]):
        part = file[i]
        data, names, steps = part["data"], part["Channel names"], part.get("Delta_X", [])
        for k in range(data.shape[1]):
            clean = np.asarray(data[:, k], dtype=np.float64)
            if file["X_Columns"] == "No" and np.isfinite(clean).all() and len(steps) > k:
                unit = (part.get("Y_Unit_Label") or [""] * data.shape[1])[k].strip()
                found.append(Series(names[k].strip(), clean, unit or None, 1 / steps[k] if steps[k] else None))
    return found


def _mdf(path: Path) -> list[Series]:
    import asammdf

    with asammdf.MDF(path) as file:
        start = file.header.start_time
        begin = int((start if start.tzinfo else start.replace(tzinfo=UTC)).timestamp() * 1e6) * 1000
        found = []
        for group in file.virtual_groups:
            for signal in file.select([(None, g, c) for g, c in _mdf_channels(file, group)], validate=False) or ():
                if signal.samples.dtype.names or signal.samples.ndim > 1 or not len(signal.timestamps):
                    continue
                if signal.samples.dtype.kind == "S":
                    found.append(Series(signal.name, [cell.decode("utf-8", "replace") for cell in signal.samples]))
                    continue
                first = begin + round(1e9 * float(signal.timestamps[0])) if start.year > 1970 else None
                found.append(_series(signal.name, signal.samples, unit=signal.unit or None, start_ns=first))
        return found


def _mdf_channels(file: Any, group: int) -> list[tuple[int, int]]:  # noqa: ANN401
    return [(g, c) for g, channels in file.included_channels(group)[group].items() for c in channels]


def _matlab(path: Path) -> list[Series]:
    from scipy.io import loadmat

    found = []
    for name, value in loadmat(path, struct_as_record=True).items():
        if (
            isinstance(value, np.ndarray)
            and value.dtype.kind in "iufb"
            and value.size > 1
            and value.ndim == 2
            and 1 in value.shape
            and name[0] != "_"
        ):
            found.append(Series(name, value.ravel()))
    return found


def _hdf5(path: Path) -> list[Series]:
    import h5py

    found = []

    def visit(name: str, node: object) -> None:
        if isinstance(node, h5py.Dataset) and node.ndim == 1 and node.size > 1 and node.dtype.kind in "iuf":
            if str(node.attrs.get("NAME", b"")).startswith("b'This is a netCDF dimension"):
                return
            if node.is_virtual or node.external or {"scale_factor", "add_offset", "_FillValue"} & set(node.attrs):
                return
            unit = node.attrs.get("units")
            found.append(Series(name.rpartition("/")[2], node[()], unit if isinstance(unit, str) else None))
        elif isinstance(node, h5py.Dataset) and node.ndim == 1 < node.size and h5py.check_string_dtype(node.dtype):
            found.append(Series(name.rpartition("/")[2], [str(cell) for cell in node.asstr(errors="replace")[()]]))

    with h5py.File(path) as file:
        file.visititems(visit)
    return found


def _parquet(path: Path) -> list[Series]:
    from pyarrow import parquet, types

    table = parquet.read_table(path)
    found = []
    for name, column in zip(table.column_names, table.columns, strict=True):
        if types.is_integer(column.type) or types.is_floating(column.type) or types.is_boolean(column.type):
            found.append(Series(name, column.to_pandas().to_numpy(dtype=np.float64, na_value=np.nan)))
        elif types.is_string(column.type):
            found.append(Series(name, [str(text) for text in column.to_pylist() if text is not None]))
    return found


def _wav(path: Path) -> list[Series]:
    import soundfile

    values, rate = soundfile.read(path, dtype="float64", always_2d=True)
    bits = {"PCM_U8": 7, "PCM_16": 15, "PCM_24": 23, "PCM_32": 31}.get(soundfile.info(path).subtype)
    if bits is not None:
        values = np.round(values * 2.0**bits) + (128 if bits == 7 else 0)
    return [Series("", column, None, float(rate)) for column in values.T]


def _c3d(path: Path) -> list[Series]:
    import ezc3d

    file = ezc3d.c3d(str(path))
    analog, given = file["data"]["analogs"][0], file["parameters"]
    names, units = (given["ANALOG"].get(key, {}).get("value", []) for key in ("LABELS", "UNITS"))
    rate = file["header"]["analogs"]["frame_rate"]
    found = [
        Series(names[i] if i < len(names) else "", row, (units[i] if i < len(units) else "") or None, rate or None)
        for i, row in enumerate(analog)
        if row.size
    ]
    points = file["data"]["points"]
    labels = given["POINT"].get("LABELS", {}).get("value", [])
    rate = file["header"]["points"]["frame_rate"] or None
    found += [
        Series(labels[i] if i < len(labels) else "", points[axis, i], None, rate)
        for i in range(points.shape[1])
        for axis in range(3)
        if np.isfinite(points[axis, i]).any()
    ]
    return found


def _ide(path: Path) -> list[Series]:
    import idelib

    found = []
    with idelib.importFile(str(path)) as file:
        for channel in file.channels.values():
            session = channel.getSession()
            if len(session):
                values = session.arraySlice()
                for i, part in enumerate(channel.children):
                    units = part.units[1] if part.units else None
                    found.append(
                        Series(
                            part.displayName or part.name, np.asarray(values[1 + i], dtype=np.float64), units or None
                        )
                    )
    return found


def _rosbag(path: Path) -> list[Series]:
    """How many messages of each topic there are, as numbers of a series of receipt times."""
    from rosbags.rosbag1 import Reader

    times: dict[str, list[int]] = {}
    with Reader(path) as file:
        first = file.start_time
        for connection, stamp, _ in file.messages():
            times.setdefault(connection.topic, []).append(stamp - first)
    return [Series(topic, np.array(stamps)) for topic, stamps in times.items()]


def _db3(path: Path) -> list[Series]:
    """The same of each topic of a bag of ROS 2, as SQLite itself gives its tables."""
    import sqlite3

    found: dict[str, list[int]] = {}
    with closing(sqlite3.connect(f"file:{path}?immutable=1", uri=True)) as file:
        rows = file.execute(
            "SELECT name, timestamp FROM messages JOIN topics ON topics.id = topic_id ORDER BY messages.id"
        )
        for topic, stamp in rows.fetchall():
            found.setdefault(topic, []).append(stamp)
        first = file.execute("SELECT timestamp FROM messages ORDER BY id LIMIT 1").fetchone() or (0,)
    return [Series(topic, np.array(stamps) - first[0]) for topic, stamps in found.items()]


def _ulog(path: Path) -> list[Series]:
    from pyulog import ULog

    found = []
    for one in ULog(str(path)).data_list:
        kinds = {field.field_name: field.type_str for field in one.field_data}
        found += [Series(name, one.data[name].astype(np.float64)) for name in kinds if kinds[name] != "char"]
    return found


def _xlsx(path: Path) -> list[Series]:
    """The columns of numbers of each worksheet, by calamine; names where its first row has them."""
    import pandas

    found = []
    for table in pandas.read_excel(path, sheet_name=None, engine="calamine").values():
        numbers = table.dropna(how="all").select_dtypes("number")
        named = not any(re.fullmatch(r"[-+]?\d+(\.\d+)?", str(name)) for name in table.columns)
        columns = ((str(name), numbers[name].to_numpy(dtype=np.float64)) for name in numbers if named)
        found += [Series("" if re.match(r"Unnamed", name) else re.sub(r"\.\d+$", "", name), column)
                  for name, column in columns if np.isfinite(column).any()]  # fmt: skip
    return found


def _mcap(path: Path) -> list[Series]:
    """The same of each topic of an MCAP file, by the times of logging."""
    from mcap.reader import make_reader

    times: dict[str, list[int]] = {}
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            times.setdefault(channel.topic, []).append(message.log_time)
    first = min(map(min, times.values()), default=0)
    return [Series(topic, np.array(stamps) - first) for topic, stamps in times.items()]


def _csv(path: Path) -> list[Series]:
    import pandas

    table = pandas.read_csv(path, sep=None, engine="python", comment="#", encoding="utf-8-sig")
    if any(re.fullmatch(r"\s*[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?(?:\.\d+)?\s*", str(name)) for name in table.columns):
        table = pandas.read_csv(path, sep=None, engine="python", comment="#", header=None)
    numbers = table.select_dtypes("number")
    names = ("" if re.match(r"\d+$|Unnamed", str(name)) else str(name).lstrip("%") for name in numbers)
    columns = zip(names, (numbers[name].to_numpy(dtype=np.float64) for name in numbers), strict=True)
    return [Series(name, column) for name, column in columns if np.isfinite(column).any()]


def _forces(path: Path) -> list[Series]:
    table = np.loadtxt(path, skiprows=5)
    return [Series("", column) for column in table.T[1:]]


def _series(name: str, values: NDArray[Any], **known: Any) -> Series:  # noqa: ANN401
    """Numbers, or texts where the values are none."""
    if values.dtype.kind in "iufb":
        return Series(name, values.astype(np.float64), **known)
    texts = [v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v) for v in values.ravel()]
    return Series(name, [text.strip("\0 ") for text in texts])


for _noisy in ("nptdms", "asammdf", "idelib"):
    logging.getLogger(_noisy).setLevel(logging.CRITICAL)

LIBRARIES = {
    "ASAM MDF": Library("asammdf", _mdf),
    "C3D": Library("ezc3d", _c3d, None),
    "CSV": Library("pandas", _csv, 1),
    "Cortex forces": Library("numpy", _forces, 1),
    "HDF5": Library("h5py", _hdf5),
    "LabVIEW LVM": Library("lvm_read", _lvm, 1),
    "MATLAB": Library("scipy", _matlab),
    "MCAP": Library("mcap", _mcap),
    "NI TDMS": Library("npTDMS", _tdms),
    "Parquet": Library("pyarrow", _parquet),
    "Excel workbook": Library("calamine", _xlsx),
    "ROS 1 bag": Library("rosbags", _rosbag),
    "ROS 2 bag": Library("SQLite", _db3),
    "ULog": Library("pyulog", _ulog),
    "UFF": Library("pyuff", _uff),
    "WAV": Library("soundfile", _wav),
    "enDAQ IDE": Library("idelib", _ide, None),
}
"""The library against which each format of the manifest is held."""
