"""When the first sample was taken: as other people's writers state it, format by format, and as a run keeps it."""

import struct
from datetime import UTC, datetime, timedelta, timezone

import h5py
import numpy as np
import polars
import pytest
import pyuff
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter

from testbench.ingestion.ingest import Ingest
from testbench.ingestion.planned_runs import PlannedRun
from testbench.quality.log_description import describe_log
from testbench.recording import StartTime, earliest, point_in_time
from testbench.store import open_run
from testbench.store.archive import archive

from . import reading
from .reading import in_process  # noqa: F401

RAMP = np.arange(20.0)


def tdms(path, **properties):
    """A waveform of npTDMS with these properties."""
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("g", "a", RAMP, {"wf_increment": 0.5, **properties})])


def mdf(path, version, start):
    """A file of asammdf that starts then."""
    with MDF(version=version) as file:
        file.start_time = start
        file.append([Signal(RAMP, RAMP / 4 + 1.5, name="a", unit="N")], common_timebase=True)
        file.save(path, overwrite=True)


def uff(path, date):
    """A function of pyuff with a date."""
    fields = {
        "type": 58,
        "binary": 0,
        "func_type": 1,
        "id1": "a",
        "id3": date,
        "rsp_node": 1,
        "rsp_dir": 1,
        "data": RAMP,
    }
    fields |= {"x": RAMP / 8, "ord_data_type": 4, "abscissa_spacing": 1, "abscissa_spec_data_type": 17, "ref_node": 0}
    pyuff.UFF(str(path)).write_sets(
        fields | {"ref_dir": 0, "ordinate_spec_data_type": 12, "orddenom_spec_data_type": 0}, "overwrite"
    )


def wav(path, date, time):
    """A broadcast wave."""
    extension = bytes(320) + date.encode() + time.encode() + bytes(264)
    form, data = struct.pack("<HHIIHH", 1, 1, 8, 16, 2, 16), RAMP.astype("<i2").tobytes()
    chunks = ((b"bext", extension), (b"fmt ", form), (b"data", data))
    body = b"WAVE" + b"".join(name + struct.pack("<I", len(raw)) + raw for name, raw in chunks)
    path.write_bytes(b"RIFF" + struct.pack("<I", len(body)) + body)


def lvm(path, date, time):
    """A LabVIEW measurement whose first abscissa is 0.5 s."""
    head = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tNo\n***End_of_Header***\t\n\t\n"
    head += f"Channels\t1\nSamples\t2\nDate\t{date}\nTime\t{time}\nX_Dimension\tTime\nX0\t0.5\nDelta_X\t0.01\n"
    path.write_text(head + "***End_of_Header***\nX_Value\ta\n\t1.0\n\t2.0\n")


def netcdf(path, unit, start=None):
    """HDF5 with a unit of time, and a start as NeXus has it."""
    with h5py.File(path, "w") as file:
        file["time"] = RAMP
        file["time"].attrs["units"] = unit
        file["a"] = RAMP
        if start:
            file["entry/start_time"] = start


def table(head, *rows):
    """A text of these lines."""
    return lambda path: path.write_text("\n".join([*head, *(rows or [f"{i / 10:.1f},{i}.5" for i in range(30)]), ""]))


BERLIN = timezone(timedelta(hours=2))
STAMPS = [datetime(2024, 5, 1, 12, 0, 0, 250000) + timedelta(seconds=i) for i in range(9)]
ROWS = ["2024-05-01T12:00:00.25+02:00,1.5", "2024-05-01T12:00:00.50+02:00,2.5", "2024-05-01T12:00:00.75+02:00,3.5"]
CASES = {
    "tdms": (lambda p: tdms(p, wf_start_time=np.datetime64("2024-05-01T12:00:00.25"), wf_start_offset=1.5),
             "2024-05-01T12:00:01.75Z"),
    "never set.tdms": (lambda p: tdms(p, wf_start_time=np.datetime64("1904-01-01T00:00:00")), None),
    "mf4": (lambda p: mdf(p, "4.10", datetime(2024, 5, 1, 12, 0, 0, tzinfo=BERLIN)),
            "2024-05-01T12:00:01.5+02:00"),
    "mdf": (lambda p: mdf(p, "3.30", datetime(2024, 5, 1, 12, 0, 0, tzinfo=UTC)), "2024-05-01T12:00:01.5Z"),
    "uff": (lambda p: uff(p, "01-May-24 12:00:00"), "2024-05-01T12:00:00"),
    "a text that is no date.uff": (lambda p: uff(p, "NONE"), None),
    "wav": (lambda p: wav(p, "2024-05-01", "12_00_00"), "2024-05-01T12:00:00"),
    "lvm": (lambda p: lvm(p, "2024/05/01", "12:00:00.123456789012345"), "2024-05-01T12:00:00.623456789"),
    "a date in either order.lvm": (lambda p: lvm(p, "03/04/2024", "12:00:00"), None),
    "nc": (lambda p: netcdf(p, "seconds since 2024-05-01 12:00:00"), "2024-05-01T12:00:00Z"),
    "nxs": (lambda p: netcdf(p, "s", "2024-05-01T12:00:00.5+02:00"), "2024-05-01T12:00:00.5+02:00"),
    "parquet": (lambda p: polars.DataFrame({"time": STAMPS, "a": RAMP[:9]}).write_parquet(p), "2024-05-01T12:00:00.25"),
    "times with a zone.csv": (table(["Time,F (N)"], *ROWS), "2024-05-01T12:00:00.25+02:00"),
    "times of day.csv": (table(["Time,F (N)"], "12:00:00.25,1.5", "12:00:00.50,2.5", "12:00:00.75,3.5"), None),
    "unix.csv": (table(["unix time,F (N)"], *(f"17145646{i:02}.5,{i}.5" for i in range(30))), "2024-05-01T11:56:40.5Z"),
    "ms.csv": (table(["unix_ms,F (N)"], *(f"17145646{i:02}500,{i}.5" for i in range(30))), "2024-05-01T11:56:40.5Z"),
    "epoch.csv": (table(["epoch,F (N)"], *(f"17145646{i:02}500,{i}.5" for i in range(30))), "2024-05-01T11:56:40.5Z"),
    "above.csv": (table(["# Start time: 2024-05-01 12:00:00", "Time (s),F (N)"]), "2024-05-01T12:00:00"),
    "apart.csv": (table(["Date,01.05.2024", "Time,12:00:00", "", "Time (s),F (N)"]), "2024-05-01T12:00:00"),
    "nothing.csv": (table(["Time (s),F (N)"]), None),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
@pytest.mark.usefixtures("in_process")
def test_each_format_states_its_start(tmp_path, name):
    """Its first sample's, in the zone in which it is written; none where the log states none, or not exactly one."""
    write, expected = CASES[name]
    path = tmp_path / (name if "." in name else f"log.{name}")
    write(path)
    found = {check.start_time and check.start_time.time for check in describe_log(path).groups}
    assert found == {expected}


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("05_slamstick_SSX66115.IDE", "2018-06-21T18:21:56.004547Z"),
        ("06_canmod_imu_60FEB5A8.mf4", "2021-07-26T05:19:59.72115Z"),
        ("03_hammer_two_blocks.lvm", "2013-08-30T09:18:17.725441"),
    ],
)
def test_public_recordings_state_their_start(name, expected):
    """As idelib and asammdf have it; LabVIEW's is local time of no stated zone."""
    found = earliest(check.start_time for check in reading.read_real(name).checks.values())
    assert found.time == expected


def test_a_run_keeps_its_start_where_nexus_has_it(tmp_path, command):
    """In the run and its groups, in NXentry/start_time, in the list of runs; with what states it, and how well."""
    lvm(tmp_path / "a.lvm", "2024/05/01", "12:00:00.5")
    Ingest(tmp_path / "c").run(PlannedRun("a", (tmp_path / "a.lvm",)))
    run = open_run(tmp_path / "c" / "a.h5")
    expected = StartTime("2024-05-01T12:00:01", "Date, Time", 0.1)
    assert (run.start_time, run.groups[0].start_time) == (expected, expected)
    with h5py.File(run.path) as file:
        assert file["entry/start_time"].asstr()[()] == expected.time
        assert file["entry/a"].attrs["start_time"] == expected.time
    assert expected.time in command("list", tmp_path / "c")[1]
    archive(run, tmp_path / "archive")
    stored = open_run(tmp_path / "archive" / "a.h5").groups[0]
    assert (stored.start_time, stored.zero) == (expected, run.groups[0].zero)


def test_points_in_time_are_shifted_exactly():
    """A nanosecond is one; what float64 holds no better than to the microsecond is not called finer."""
    begin = StartTime("2024-05-01T23:59:59.999999999+05:30", "log", 1e-9)
    assert begin.later(2e-9) == StartTime("2024-05-02T00:00:00.000000001+05:30", "log", 1e-9)
    assert point_in_time(0, "log").later(1714564600.123456789) == StartTime("2024-05-01T11:56:40.123457Z", "log", 1e-6)
    assert begin.nanoseconds == 1714588199999999999
    assert earliest([StartTime("2020-01-01T00:00:00", "local"), begin, None]) == begin
