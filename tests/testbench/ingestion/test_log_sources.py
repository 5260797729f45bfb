"""Logs of one run: their digests, and groups that are called alike."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from testbench.errors import RecordingError
from testbench.ingestion import Ingest, log_sources
from testbench.ingestion.log_sources import LogReading, Source, distinct_groups
from testbench.ingestion.planned_runs import PlannedRun
from testbench.readers import open_recording
from testbench.readers.csv import text_blocks
from testbench.readers.import_description import ImportDescription
from testbench.recording import Block, Channel, Group, Recording, UniformClock
from testbench.rig import load_rig
from testbench.store import atomic_files, open_run


def _recording(path, *names):
    groups = tuple(Group(name, (Channel("a"),), UniformClock(1.0)) for name in names)
    late = Group("late", (Channel("a"),))

    def read(report):
        for group in (*groups, late):
            yield Block(group, (np.zeros(2),), 0)

    return Recording(Path(path), "Test", "test", groups, read)


def test_names_that_differ_stay():
    """Nothing is renamed where no name comes twice."""
    recordings = [_recording("one.x", "a", "b"), _recording("two.x", "c")]
    assert distinct_groups(recordings) == recordings


def test_names_that_come_twice_get_their_file():
    """All groups of the files that share a name, those included that come while it is read."""
    one, two, other = distinct_groups(
        [_recording("1/run.x", "DAQ"), _recording("2/run.x", "DAQ", "b"), _recording("c.x", "c")]
    )
    assert [group.name for group in one.groups + two.groups] == ["run 1 DAQ", "run 2 DAQ", "run 2 b"]
    assert [block.group.name for block in two.blocks(print)] == ["run 2 DAQ", "run 2 b", "run 2 late"]
    assert [group.name for group in other.groups] == ["c"]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "cp1254"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("block", [64, 1 << 20])
def test_digest_of_what_is_read(tmp_path, monkeypatch, encoding, end, block):
    """Of each byte, those of a mark and of a last line without an end too; the file is not read a second time."""
    path = tmp_path / "log.csv"
    rows = end.join(f"{i / 1000:.3f},{i % 7}" for i in range(40))
    path.write_bytes(f"# kayıt{end}Time (s),AccX (g){end}{rows}".encode(encoding))
    monkeypatch.setattr(text_blocks, "BLOCK_BYTES", block)
    expected = atomic_files.sha256_of(path)
    monkeypatch.setattr(atomic_files, "sha256_of", lambda *_, **__: pytest.fail("it is read a second time"))
    source = Source(path, LogReading())
    assert source.sha256 == ""
    assert sum(len(found) for found in source.recording.blocks(lambda finding: None)) == 40
    assert source.digested() == expected


def test_two_loggers_of_one_kind_make_one_run(tmp_path):
    """Their data are stored side by side, and not one behind the other."""
    for name, factor in (("left", 1.0), ("right", -2.0)):
        with TdmsWriter(tmp_path / f"{name}.tdms") as writer:
            writer.write_segment([ChannelObject("DAQ", "a", factor * np.arange(9.0), {"wf_increment": 0.5})])
    planned = PlannedRun("r1", (tmp_path / "left.tdms", tmp_path / "right.tdms"))
    outcomes = Ingest(tmp_path / "campaign").run(planned)
    assert [outcome.status for outcome in outcomes] == ["stored", "stored"]
    run = open_run(tmp_path / "campaign" / "r1.h5")
    np.testing.assert_array_equal(run.channel("a", "left DAQ"), np.arange(9.0))
    np.testing.assert_array_equal(run.channel("a", "right DAQ"), -2 * np.arange(9.0))


RIG = """mechanism = "none"
[loggers.daq]
read_as = "daq.toml"
[loggers.plc]
read_as = "plc.toml"
[sensors.force]
kind = "force"
logger = "daq"
channel = "K1"
axis = "x"
position = ["0 m", "0 m", "0 m"]
[sensors.angle]
kind = "encoder"
logger = "plc"
channel = "angle"
joint = "A0"
unit = "deg"
"""
DESCRIPTIONS = {
    "daq.toml": 'channels = { "Clock" = "Time (s)", "Kraft 1" = "K1 (N)" }',
    "plc.toml": 'channels = { "millis" = "Time (ms)", "winkel" = "angle (deg)" }',
}
ROWS = "\n".join(f"{2 * i},{i * i % 7}" for i in range(50))


@pytest.fixture
def bench(tmp_path):
    """A rig beside the descriptions of its two loggers, and a log of each."""
    for name, text in {"rig.toml": RIG, **DESCRIPTIONS}.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "daq.csv").write_text(f"Clock,Kraft 1\n{ROWS}\n")
    (tmp_path / "plc.csv").write_text(f"millis,winkel\n{ROWS}\n")
    return tmp_path


def test_each_logger_of_a_rig_has_its_import_description(bench):
    """A run of logs of both is stored, each at its own rate: a column that is renamed to a time is the clock."""
    work = Ingest(bench / "c", load_rig(bench / "rig.toml"))
    outcomes = work.run(PlannedRun("r", (bench / "daq.csv", bench / "plc.csv")))
    assert [(one.status, one.message) for one in outcomes] == [("stored", "")] * 2
    run = open_run(bench / "c" / "r.h5")
    assert {group.channels[1].name: group.rate_hz for group in run.groups} == pytest.approx(
        {"K1 (N)": 0.5, "angle (deg)": 500.0}
    )
    kept = [source["settings"]["import_description"] for source in run.provenance["sources"]]
    assert kept == list(DESCRIPTIONS.values())


def test_logs_and_descriptions_are_opened_no_more_often_than_needed(bench, monkeypatch):
    """A log once by each description, however many loggers have it; descriptions once, also for a copy of the work."""
    opened, loaded = [], []
    load = ImportDescription.load.__func__
    monkeypatch.setattr(
        ImportDescription, "load", classmethod(lambda cls, name: loaded.append(name) or load(cls, name))
    )
    monkeypatch.setattr(
        log_sources, "open_recording", lambda path, *given: opened.append(path.name) or open_recording(path, *given)
    )
    (bench / "rig.toml").write_text(RIG.replace('"plc.toml"', '"daq.toml"'))
    work = replace(Ingest(bench / "c", load_rig(bench / "rig.toml")), accepted=frozenset())
    assert [one.status for one in work.run(PlannedRun("r", (bench / "daq.csv",)))] == ["stored"]
    assert (opened, len(loaded)) == (["daq.csv"], 1)


def test_loggers_that_call_their_channels_alike(bench):
    """A log is of the description whose names it has all; those that it lacks of its own are found in another log."""
    (bench / "plc.toml").write_text('channels = { "Clock" = "Time (ms)", "Kraft 1" = "angle (deg)", "w" = "w2 (deg)" }')
    reading = LogReading(rig=load_rig(bench / "rig.toml"))
    assert "Time (s)" in reading.options(bench / "daq.csv").description.channels.values()
    (bench / "daq.toml").write_text('channels = { "Clock" = "Time (s)", "Kraft 1" = "K1 (N)", "Kraft 2" = "K2 (N)" }')
    (bench / "plc.toml").write_text(DESCRIPTIONS["plc.toml"])
    (bench / "daq 2.csv").write_text(f"Clock,Kraft 1,Kraft 2\n{ROWS.replace(',', ',1,')}\n")
    for logs, codes in ((["daq.csv"], {"channel_not_found"}), (["daq.csv", "daq 2.csv"], {"channel_elsewhere"})):
        work = Ingest(bench / f"c{len(logs)}", load_rig(bench / "rig.toml"))
        work.reading.add_logs(bench / name for name in logs)
        (outcome,) = work.run(PlannedRun("r", (bench / "daq.csv",)))
        assert {f.code for f in outcome.findings if f.code.startswith("channel_")} == codes


def test_a_channel_that_both_loggers_call_alike(bench):
    """One description renames it; a log is of the logger whose channels in the rig it has all, whatever is in both."""
    sync = '[sensors.sync_{0}]\nkind = "trigger"\nlogger = "{0}"\nchannel = "{1}"\n'
    (bench / "rig.toml").write_text(RIG + sync.format("daq", "Sync") + sync.format("plc", "Sync plc"))
    (bench / "daq.toml").write_text('name = "daq"')
    (bench / "plc.toml").write_text("channels = { 'Sync' = 'Sync plc' }")
    rows = "\n".join(f"{i},{i * i % 7},{i // 20}" for i in range(50))
    (bench / "daq.csv").write_text(f"Time (s),K1 (N),Sync (V)\n{rows}\n")
    (bench / "plc.csv").write_text(f"Time (s),angle (deg),Sync (V)\n{rows}\n")
    outcomes = Ingest(bench / "c", load_rig(bench / "rig.toml")).run(
        PlannedRun("r", (bench / "daq.csv", bench / "plc.csv"))
    )
    assert [(one.status, one.message) for one in outcomes] == [("stored", "")] * 2
    run = open_run(bench / "c" / "r.h5")
    assert [run.find(name)[0].name for name in ("Sync", "Sync plc")] == ["daq", "plc"]


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("rig.toml", "plc.toml", "pcl.toml", "pcl.toml"),
        (
            "rig.toml",
            "plc.toml",
            "../plc.toml",
            r"loggers\.plc\.read_as: '\.\./plc\.toml': expected a file in the rig's f",
        ),
        (
            "rig.toml",
            "plc.toml",
            "/plc.toml",
            r"loggers\.plc\.read_as: '/plc\.toml': expected a file in the rig's folder",
        ),
        ("plc.csv", "winkel", "Kraft 1", r"plc\.csv: holds channels of the loggers daq, plc, .* different import desc"),
        ("daq.toml", "channels =", 'time = "Clock"\nchannels =', ""),
        (
            "daq.toml",
            '"Clock" =',
            'rate = "1 kHz", "Clock" =',
            r"daq\.csv: .* channels\.rate: the setting rate stands below",
        ),
        ("daq.csv", "Clock,Kraft 1", "Uhr,K1", r"daq\.csv: no column 'Clock'"),
    ],
    ids=[
        "not there",
        "above",
        "elsewhere",
        "of two loggers",
        "stated as well",
        "a setting below",
        "its time is not there",
    ],
)
def test_a_description_that_does_not_fit_is_said(bench, file, old, new, said, monkeypatch):
    """Nothing is read by another description than its logger's in silence, nor by one that lies elsewhere."""
    (bench / "elsewhere").mkdir()
    (bench / "elsewhere" / "pcl.toml").write_text(DESCRIPTIONS["plc.toml"])
    monkeypatch.chdir(bench / "elsewhere")
    (bench / file).write_text((bench / file).read_text().replace(old, new))
    if file == "plc.csv":
        (bench / "plc.toml").write_text('channels = { "Kraft 1" = "angle (deg)" }')
        (bench / "plc.csv").write_text(f"Clock,Kraft 1\n{ROWS}\n")
    if file == "daq.csv":
        (bench / "daq.toml").write_text('time = "Clock"')
    if not said:
        assert LogReading(rig=load_rig(bench / "rig.toml")).options(bench / "daq.csv").description is not None
        return
    with pytest.raises(RecordingError, match=said):
        LogReading(rig=load_rig(bench / "rig.toml")).options(bench / f"{file[:3].replace('rig', 'daq')}.csv")
