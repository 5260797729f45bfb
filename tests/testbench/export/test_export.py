"""Runs in other forms: the same bits with units and time, the origin beside them, nothing overwritten."""

import errno
import json

import click
import numpy as np
import polars
import pytest

from testbench.cli.export import export as command
from testbench.describe import describe
from testbench.errors import StoreError
from testbench.export import export, sep005
from testbench.ingest import Ingest
from testbench.ingest.runsheet import plan
from testbench.readers import open_recording
from testbench.recording import Channel, Group, TimeColumn, UniformClock
from testbench.store import open_campaign, open_run
from testbench.store.writer import RunWriter

SAMPLES = 3000
TIME = np.cumsum(np.random.default_rng(1).uniform(0.9e-3, 1.1e-3, SAMPLES))
ACC = np.random.default_rng(2).normal(size=SAMPLES) * 10.0 ** np.random.default_rng(3).integers(-300, 300, SAMPLES)
ACC[:2] = -0.0, 5e-324
RECORDED = Group(
    "daq", (Channel("t [s]", "s", "t"), Channel("İvme X, ön", "m/s²"), Channel("F (N)", "N", "F")), TimeColumn(0)
)
UNIFORM = Group("forces", (Channel("Fz (N)", "N", "Fz"), Channel("Fz (N)", "N", "Fz")), UniformClock(2000.0, 0.25))


@pytest.fixture
def run(tmp_path):
    """A run of two groups, one with a recorded clock and one with a rate."""
    source = {"name": "log.csv", "sha256": "0" * 64, "size_bytes": 1}
    with RunWriter(tmp_path / "c", "r001") as writer:
        for group, columns in ((RECORDED, [TIME, ACC, ACC[::-1].copy()]), (UNIFORM, [ACC[:500], ACC[500:1000]])):
            writer.group(group).append(columns)
            writer.group(group).finish(*((2000.0, "declared") if group is UNIFORM else (1000.0, "median_step")))
        writer.describe("simulated", {"payload_kg": 5.0}, [], {"sources": [source], "written": "now"}, None)
        return open_run(writer.commit())


def read_back(path):
    """Every column of a log by our own reader."""
    recording = open_recording(path)
    blocks = list(recording.blocks(lambda finding: None))
    return recording, [np.concatenate(parts) for parts in zip(*(block.columns for block in blocks), strict=True)]


def test_csv_reads_back_to_the_same_bits(run, tmp_path):
    """Through our own reader: each number, name, unit, the clock and the origin; awkward numbers included."""
    recorded, uniform = export(run, "csv", tmp_path / "out")
    recording, columns = read_back(recorded.file)
    assert [c.tobytes() for c in columns] == [TIME.tobytes(), ACC.tobytes(), ACC[::-1].tobytes()]
    assert [c.unit for c in recording.groups[0].channels] == ["s", "m/s²", "N"]
    assert recording.origin == "simulated"
    recording, columns = read_back(uniform.file)
    assert [c.tobytes() for c in columns[1:]] == [ACC[:500].tobytes(), ACC[500:1000].tobytes()]
    assert columns[0].tobytes() == run.time("forces").tobytes()
    assert [f.code for f in describe(uniform.file).findings if f.severity == 2] == []


def test_what_is_no_number_reads_back(tmp_path):
    """NaN and both infinities."""
    (tmp_path / "log.csv").write_text("t (s),x (V)\n0.0,1.5\n0.1,nan\n0.2,inf\n0.3,-inf\n0.4,2.5\n")
    Ingest(tmp_path / "c").run(plan([tmp_path / "log.csv"], None)[0])
    (run,) = open_campaign(tmp_path / "c").runs
    (written,) = export(run, "csv", tmp_path / "out")
    assert read_back(written.file)[1][1].tolist()[2:] == [np.inf, -np.inf, 2.5]
    assert np.isnan(read_back(written.file)[1][1][1])


def test_parquet(run, tmp_path):
    """The same bits; units, origin and sources in the metadata; two channels of one name stay two."""
    recorded, uniform = export(run, "parquet", tmp_path / "out")
    table = polars.read_parquet(recorded.file)
    assert table["İvme X, ön"].to_numpy().tobytes() == ACC.tobytes()
    known = json.loads(polars.read_parquet_metadata(recorded.file)["counterpoise"])
    assert (known["units"]["İvme X, ön"], known["origin"], known["conditions"]) == (
        "m/s²",
        "simulated",
        {"payload_kg": 5},
    )
    assert polars.read_parquet(uniform.file).columns == ["time (s)", "Fz (N)", "Fz (N)_2"]


def test_mat(run, tmp_path):
    """A struct a group: names, units, data, time."""
    from scipy.io import loadmat

    (written,) = export(run, "mat", tmp_path / "out")
    content = loadmat(written.file, simplify_cells=True)
    channel = content["group_daq"]["channel_Ivme_X_on"]
    assert (channel["name"], channel["unit"]) == ("İvme X, ön", "m/s²")
    assert channel["data"].tobytes() == ACC.tobytes()
    assert content["group_forces"]["channel_time_s"]["data"].tobytes() == run.time("forces").tobytes()
    assert json.loads(content["counterpoise"])["origin"] == "simulated"


def test_uff_by_its_own_library_and_by_our_reader(run, tmp_path):
    """58b with every time in full: the same bits; what ASCII does not hold is said."""
    pyuff = pytest.importorskip("pyuff")
    (written,) = export(run, "uff", tmp_path / "out")
    sets = pyuff.UFF(str(written.file)).read_sets()
    assert [s["data"].tobytes() for s in sets[:2]] == [ACC.tobytes(), ACC[::-1].tobytes()]
    assert sets[0]["x"].tobytes() == TIME.tobytes()
    assert sets[1]["ordinate_axis_units_lab"].strip() == "N"
    assert any("m/s²" in loss for loss in written.losses)
    ours = [column.tobytes() for column in read_back_groups(written.file)]
    assert ACC.tobytes() in ours
    assert TIME.tobytes() in ours


def read_back_groups(path):
    """Every column of every group."""
    parts = {}
    for block in open_recording(path).blocks(lambda finding: None):
        for i, column in enumerate(block.columns):
            parts.setdefault((block.group.name, i), []).append(column)
    return [np.concatenate(columns) for columns in parts.values()]


def test_sep005(run):
    """The keys of the proposal: data, name, unit_str, and fs or time."""
    first, second, third, fourth = sep005(run)
    assert (first["name"], first["unit_str"], second["unit_str"]) == ("İvme X, ön", "m/s²", "N")
    assert first["time"].tobytes() == TIME.tobytes()
    assert third["fs"] == fourth["fs"] == 2000.0
    assert all(len(s["data"]) == len(s.get("time", s["data"])) and ("fs" in s) != ("time" in s) for s in sep005(run))


def test_ro_crate(run, tmp_path, capsys):
    """The runs with their digests, and a description in which every reference leads somewhere."""
    words = [str(tmp_path / "c"), "--to", "ro-crate", "-o", str(tmp_path / "crate")]
    assert command.main([*words, "--licence", "CC-BY-4.0"], standalone_mode=False) == 0
    document = json.loads((tmp_path / "crate" / "ro-crate-metadata.json").read_text("utf-8"))
    nodes = {node["@id"]: node for node in document["@graph"]}
    assert nodes["ro-crate-metadata.json"]["about"] == {"@id": "./"}
    assert nodes["./"]["license"] == {"@id": "https://spdx.org/licenses/CC-BY-4.0"}
    assert all(part["@id"] in nodes and (tmp_path / "crate" / part["@id"]).is_file() for part in nodes["./"]["hasPart"])
    assert nodes["r001.h5"]["description"] == "origin: simulated"
    assert all(one["@id"] in nodes for one in (nodes["r001.h5"]["license"], *nodes["r001.h5"]["isBasedOn"]))
    states = {state.status for state in open_campaign(tmp_path / "crate").verify()}
    assert states == {"intact"}
    with pytest.raises(StoreError, match="nothing is overwritten"):
        command.main(words, standalone_mode=False)


def test_a_crate_without_a_licence_says_so(run, tmp_path, capsys):
    """Nobody's licence is guessed; the campaign itself may be the crate."""
    words = [str(tmp_path / "c"), "--to", "ro-crate", "-o", str(tmp_path / "c")]
    assert command.main(words, standalone_mode=False) == 3
    assert "no licence is stated for r001" in capsys.readouterr().out
    assert {state.status for state in open_campaign(tmp_path / "c").verify()} == {"intact"}


def test_a_crate_is_whole_or_not_there(run, tmp_path, monkeypatch):
    """The disk is full at the digest of the only run, or its bytes changed: nothing is left, not even the folder."""
    from testbench.export import ro_crate
    from testbench.store import Campaign

    whole = ro_crate.shutil.copyfile

    def full(source, target):
        whole(source, target)
        if target.suffix == ".sha256":
            raise OSError(errno.ENOSPC, "No space left on device", str(source))

    monkeypatch.setattr(ro_crate.shutil, "copyfile", full)
    with pytest.raises(StoreError, match=r"crate: the crate cannot be written \(No space left on device\)"):
        ro_crate.write(Campaign(run.path.parent), [run], tmp_path / "crate", None)
    assert not (tmp_path / "crate").exists()
    monkeypatch.setattr(ro_crate.shutil, "copyfile", lambda source, target: target.write_bytes(b"other"))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    with pytest.raises(StoreError):
        ro_crate.write(Campaign(run.path.parent), [run], tmp_path / "mine", None)
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["notes.txt"]


def test_a_public_recording_carries_its_licence(tmp_path):
    """A source whose SHA-256 is registered: its licence and credit are those of its owners."""
    from testbench.export import ro_crate
    from testbench.recordings import registry
    from testbench.store import Campaign

    known = next(iter(registry().values()))
    with RunWriter(tmp_path, "r001") as writer:
        writer.group(UNIFORM).append([ACC[:9], ACC[:9]])
        writer.group(UNIFORM).finish(None, None)
        source = {"name": known.file, "sha256": known.sha256, "size_bytes": known.bytes}
        writer.describe("measured", {}, [], {"sources": [source]}, None)
        stored = open_run(writer.commit())
    assert ro_crate.write(Campaign(tmp_path), [stored], tmp_path / "crate", None).losses == ()
    text = (tmp_path / "crate" / ro_crate.NAME).read_text("utf-8")
    assert known.credit in text
    assert f"https://spdx.org/licenses/{known.licence}" in text


def test_nothing_is_overwritten(run, tmp_path):
    """A second export into the same place is refused and leaves the first as it was, and no part behind."""
    (written,) = export(run, "mat", tmp_path / "out")
    before = written.file.read_bytes()
    with pytest.raises(StoreError, match="nothing is overwritten"):
        export(run, "mat", tmp_path / "out")
    assert [p.read_bytes() for p in (tmp_path / "out").iterdir()] == [before]


def test_the_command(run, tmp_path, capsys):
    """A campaign or a run; SEP005 has no file; exit 3 where something is lost."""
    assert (
        command.main([str(tmp_path / "c"), "--to", "csv", "-o", str(tmp_path / "o"), "--json"], standalone_mode=False)
        == 0
    )
    assert len(json.loads(capsys.readouterr().out)["files"]) == 2
    with pytest.raises(click.UsageError, match="no file"):
        command.main([str(run.path), "--to", "sep005", "-o", "x"], standalone_mode=False)
    pytest.importorskip("pyuff")
    assert command.main([str(run.path), "--to", "uff", "-o", str(tmp_path / "u")], standalone_mode=False) == 3
    assert "lost:" in capsys.readouterr().out
