"""Runs in other forms: the same bits with units and time, the origin beside them, nothing overwritten."""

import errno
import hashlib
import json
from urllib.parse import unquote

import click
import numpy as np
import polars
import pytest

from testbench.cli.campaign import export as command
from testbench.errors import StoreError
from testbench.export import export, export_joined, sep005
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import plan_runs
from testbench.quality.log_description import describe_log
from testbench.readers import open_recording
from testbench.recording import Channel, Finding, Group, TimeColumn, UniformClock
from testbench.store import append_only_records, open_campaign, open_run
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
    assert [f.code for f in describe_log(uniform.file).findings if f.severity == 2] == []


def test_what_is_no_number_reads_back(tmp_path):
    """NaN and both infinities."""
    (tmp_path / "log.csv").write_text("t (s),x (V)\n0.0,1.5\n0.1,nan\n0.2,inf\n0.3,-inf\n0.4,2.5\n")
    Ingest(tmp_path / "c").run(plan_runs([tmp_path / "log.csv"], None)[0])
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


def stored(folder, channels, findings=(), name="r001", sources=({"name": "log.csv", "sha256": "", "size_bytes": 1},)):
    """A run of one group with these channels, each full of its number."""
    group = Group("g" * 80, tuple(Channel(channel, "V") for channel in channels), UniformClock(100.0, 0.0))
    with RunWriter(folder, name) as writer:
        writer.group(group).append([np.full(9, float(i)) for i in range(len(channels))])
        writer.group(group).finish(100.0, "declared")
        writer.describe("simulated", {"payload_kg": 5.0}, findings, {"sources": list(sources)}, None)
        return open_run(writer.commit())


def test_no_channel_is_lost_in_a_mat_file(tmp_path):
    """Names that are the same in the 63 characters of MATLAB, or like that of the time, stay apart."""
    from scipy.io import loadmat

    channels = ["A" * 58 + " x", "A" * 58 + " y", "A" * 70, "time s", "time"]
    (written,) = export(stored(tmp_path / "c", channels), "mat", tmp_path / "out")
    content = loadmat(written.file, simplify_cells=True)
    (group,) = (value for key, value in content.items() if key.startswith("group_"))
    found = {value["name"]: value["data"][0] for key, value in group.items() if key != "name"}
    assert found == {"time (s)": 0.0} | {channel: i for i, channel in enumerate(channels)}
    assert all(len(key) <= 63 for key in (*group, *content))


def test_a_group_larger_than_a_mat_variable(tmp_path, monkeypatch):
    """What MATLAB cannot hold is refused: all channels of a group are one variable."""
    from testbench.export import tables

    run = stored(tmp_path / "c", ["a", "b"])
    monkeypatch.setattr(tables, "LARGEST", 3 * 9 * 8 - 1)
    with pytest.raises(StoreError, match=r"216 bytes of samples.*no more than 215; use parquet"):
        export(run, "mat", tmp_path / "out")
    monkeypatch.setattr(tables, "LARGEST", 3 * 9 * 8)
    assert export(run, "mat", tmp_path / "out")


def test_what_a_form_does_not_hold_is_listed(tmp_path):
    """Findings in CSV and universal files, conditions in the latter; parquet and MAT files hold both."""
    run = stored(tmp_path / "c", ["a"], [Finding("clipping", None, None, "cut"), Finding("timebase", None, None, "x")])
    lost = {to: " ".join(export(run, to, tmp_path / "out")[0].losses) for to in ("csv", "parquet", "mat", "uff")}
    assert lost["parquet"] == lost["mat"] == ""
    assert "findings about run 'r001'" in lost["csv"]
    assert "findings about run 'r001'" in lost["uff"]
    assert "conditions" in lost["uff"]


def test_names_that_look_like_something_else_in_csv(tmp_path):
    """A comment sign in a name hides no name from pandas nor from us; a name of two lines and one of digits is said."""
    import pandas

    run = stored(tmp_path / "c", ["#1", "z#w", "a\nb"])
    (written,) = export(run, "csv", tmp_path / "out")
    table = pandas.read_csv(written.file, comment="#")
    assert list(table.columns) == ["time (s)", "#1 (V)", "z#w (V)", "a b (V)"]
    assert table.to_numpy()[:, 1:].tolist() == [[0.0, 1.0, 2.0]] * 9
    assert [len(column) for column in read_back(written.file)[1]] == [9] * 4
    assert "on one line" in written.losses[0]
    group = Group("g", (Channel("1"), Channel("2.5")))
    with RunWriter(tmp_path, "r002") as writer:
        writer.group(group).append([np.zeros(3), np.ones(3)])
        writer.group(group).finish(None, None)
        writer.describe("unstated", {}, [], {"sources": []}, None)
        (written,) = export(open_run(writer.commit()), "csv", tmp_path / "out")
    assert "are all numbers" in written.losses[0]


def test_two_exports_at_once(run, tmp_path, monkeypatch):
    """A file that came meanwhile stays as it is."""
    from testbench.export import tables

    real = tables.export_csv

    def slow(run, groups, part):
        losses = real(run, groups, part)
        (tmp_path / "out" / "r001.daq.csv").write_text("of another")
        return losses

    monkeypatch.setattr(tables, "export_csv", slow)
    with pytest.raises(StoreError, match="nothing is overwritten"):
        export(run, "csv", tmp_path / "out")
    assert {p.name: p.read_text() for p in (tmp_path / "out").iterdir()} == {"r001.daq.csv": "of another"}


def test_a_folder_that_is_a_file(run, tmp_path):
    """One clear error."""
    (tmp_path / "out").write_text("mine")
    with pytest.raises(StoreError, match=r"out: no folder to write into \(File exists\)"):
        export(run, "csv", tmp_path / "out")


def crate(folder, runs, licence):
    """The nodes of a crate of the runs, by name, and what it says is lost."""
    from testbench.export import ro_crate
    from testbench.store import Campaign

    losses = ro_crate.export_crate(Campaign(runs[0].path.parent), runs, folder, licence).losses
    document = json.loads((folder / ro_crate.NAME).read_text("utf-8"))
    return {node["@id"]: node for node in document["@graph"]}, losses


def test_a_licence_in_words_is_said_as_it_was_given(run, tmp_path):
    """It is not called unstated."""
    nodes, losses = crate(tmp_path / "crate", [run], "CC BY 4.0, ölçüm")
    identity = nodes["r001.h5"]["license"]["@id"]
    assert nodes["./"]["license"]["@id"] == identity
    assert nodes[identity]["name"] == "CC BY 4.0, ölçüm"
    assert losses == ()
    assert "No licence is stated" not in json.dumps(list(nodes.values()))


def test_the_licence_of_a_public_log_is_not_that_of_the_log_beside_it(tmp_path):
    """A run of a public and of another log has both licences, or one of them is said to be missing."""
    from testbench.public_recordings import recordings_by_file

    known = next(iter(recordings_by_file().values()))
    public = {"name": known.file, "sha256": known.sha256, "size_bytes": known.bytes}
    own = {"name": "mine.csv", "sha256": "1" * 64, "size_bytes": 1}
    run = stored(tmp_path / "c", ["a"], sources=(public, own))
    nodes, losses = crate(tmp_path / "a", [run], None)
    assert len(nodes["r001.h5"]["license"]) == 2
    assert nodes["./"]["license"] == nodes["r001.h5"]["license"]
    assert "no licence is stated for r001" in losses[0]
    assert all(one["@id"] in nodes for one in nodes["./"]["license"])
    alone = stored(tmp_path / "d", ["a"], sources=(public,))
    nodes, losses = crate(tmp_path / "e", [alone], None)
    assert (
        nodes["./"]["license"] == nodes["r001.h5"]["license"] == {"@id": f"https://spdx.org/licenses/{known.licence}"}
    )
    assert losses == ()
    nodes, losses = crate(tmp_path / "b", [run], "CC0-1.0")
    assert {one["@id"].rpartition("/")[2] for one in nodes["r001.h5"]["license"]} == {known.licence, "CC0-1.0"}
    assert losses == ()


def test_names_in_a_crate_are_references(tmp_path):
    """Blanks and signs that mean something in a URI are escaped, letters of any script are not (RO-Crate 1.1, A)."""
    run = stored(tmp_path / "c", ["a"], name="ölçüm #1 (50~)")
    nodes, _ = crate(tmp_path / "crate", [run], "MIT")
    assert "ölçüm%20%231%20(50~).h5" in nodes
    files = [unquote(part["@id"]) for part in nodes["./"]["hasPart"]]
    assert sorted([*files, "SHA256SUMS", "ro-crate-metadata.json"]) == sorted(
        p.name for p in (tmp_path / "crate").iterdir()
    )
    assert not any(set(' <>"{}|\\^`') & set(identity) for identity in nodes)


def test_a_crate_takes_the_later_records_along(run, tmp_path, monkeypatch):
    """Those about its runs and no others, described; without them a corrected calibration would be wrong again."""
    other = stored(run.path.parent, ["a"], name="other")
    about = append_only_records.append_record(run.path.parent, "calibration", [run.path], {"x": 1})
    append_only_records.append_record(run.path.parent, "calibration", [other.path], {"x": 2})
    nodes, _ = crate(tmp_path / "crate", [run], "MIT")
    assert nodes[f"records/{about.name}"]["about"] == [{"@id": "r001.h5"}]
    assert {"@id": f"records/{about.name}"} in nodes["./"]["hasPart"]
    assert [record.content for record in append_only_records.read_records(tmp_path / "crate")] == [{"x": 1}]
    monkeypatch.setattr(
        append_only_records, "_write", lambda *_: (_ for _ in ()).throw(OSError(errno.ENOSPC, "No space"))
    )
    with pytest.raises(StoreError, match="nothing of it is left"):
        crate(tmp_path / "full", [run], "MIT")
    assert not (tmp_path / "full").exists()


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
    """The keys of the proposal: data, unique name, unit_str, fs or time; when a uniform clock began is not lost."""
    first, second, third, fourth = sep005(run)
    assert (first["name"], first["unit_str"], second["unit_str"]) == ("İvme X, ön", "m/s²", "N")
    assert first["time"].tobytes() == TIME.tobytes()
    assert third["fs"] == fourth["fs"] == 2000.0
    assert [s["name"] for s in (third, fourth)] == ["forces: Fz (N)", "forces: Fz (N)_2"]
    assert "fs" not in first
    assert third["time"].tobytes() == run.time("forces").tobytes()
    assert all(s["data"].ndim == 1 and len(s["data"]) == len(s.get("time", s["data"])) for s in sep005(run))


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
    assert states == {"intact", "absent"}  # a crate has no ledger of its own
    with pytest.raises(StoreError, match="nothing is overwritten"):
        command.main(words, standalone_mode=False)
    lines = (tmp_path / "crate" / "SHA256SUMS").read_text("utf-8").splitlines()
    listed = {name: digest for digest, _, name in (line.partition("  ") for line in lines)}
    files = {path.relative_to(tmp_path / "crate").as_posix(): path for path in (tmp_path / "crate").rglob("*.*")}
    assert listed == {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in files.items()}


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
        ro_crate.export_crate(Campaign(run.path.parent), [run], tmp_path / "crate", None)
    assert not (tmp_path / "crate").exists()
    monkeypatch.setattr(ro_crate.shutil, "copyfile", lambda source, target: target.write_bytes(b"other"))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    with pytest.raises(StoreError):
        ro_crate.export_crate(Campaign(run.path.parent), [run], tmp_path / "mine", None)
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["notes.txt"]


def test_a_public_recording_carries_its_licence(tmp_path):
    """A source whose SHA-256 is registered: its licence and credit are those of its owners."""
    from testbench.export import ro_crate
    from testbench.public_recordings import recordings_by_file
    from testbench.store import Campaign

    known = next(iter(recordings_by_file().values()))
    with RunWriter(tmp_path, "r001") as writer:
        writer.group(UNIFORM).append([ACC[:9], ACC[:9]])
        writer.group(UNIFORM).finish(None, None)
        source = {"name": known.file, "sha256": known.sha256, "size_bytes": known.bytes}
        writer.describe("measured", {}, [], {"sources": [source]}, None)
        stored = open_run(writer.commit())
    assert ro_crate.export_crate(Campaign(tmp_path), [stored], tmp_path / "crate", None).losses == ()
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


def test_all_loggers_in_one_table(run, tmp_path, capsys):
    """One row an instant, as in Python; clocks that were never aligned are said, exit 3."""
    with pytest.warns(UserWarning, match="daq, forces"):
        expected = run.to_pandas(resample="4 kHz").reset_index()
    for to, read in (("csv", lambda path: polars.read_csv(path, comment_prefix="#")), ("parquet", polars.read_parquet)):
        arguments = [str(run.path), "--to", to, "--resample", "4 kHz", "-o", str(tmp_path / to)]
        assert command.main(arguments, standalone_mode=False) == 3
        assert "clocks of daq, forces are as recorded, not aligned" in capsys.readouterr().out
        written = read(tmp_path / to / f"r001.{to}")
        np.testing.assert_array_equal(written.to_numpy(), expected.to_numpy())
        assert written.columns == ["time (s)", "İvme X, ön (m/s²)", "F (N)", "Fz (N)", "forces: Fz (N)"]
    with pytest.raises(click.UsageError, match="--to csv or parquet"):
        command.main([str(run.path), "--to", "mat", "--resample", "1 kHz", "-o", "x"], standalone_mode=False)


def test_a_comment_sign_in_a_joined_table(tmp_path):
    """Names are quoted, so that one with a comment sign is no comment."""
    import pandas

    written = export_joined(stored(tmp_path / "c", ["#1", "b"]), "4 kHz", "csv", tmp_path / "out")
    table = pandas.read_csv(written.file, comment="#")
    assert list(table.columns) == ["time (s)", "#1 (V)", "b (V)"]


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
