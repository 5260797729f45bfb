"""Logs into runs: whole or not at all, once each, with what is known of them."""

import hashlib
import os
from dataclasses import replace

import numpy as np
import pytest

from balance.results import document
from testbench import rig as rigs
from testbench.ingestion import Ingest
from testbench.ingestion.planned_runs import PlannedRun
from testbench.store import open_campaign, open_run
from testbench.store.ledger import read_ledger

from ..store.stored import names_in

HEADER = "Time (s),AccX (g),AccY (g),AccZ (g)\n"
ROWS = [f"{i / 1000:.4f},{0.5 * (i % 7) - 3:.4f},{1.25 * (i % 11):.4f},{i % 5:.4f}\n" for i in range(400)]
RIG = """
name = "bench"
mechanism = "parallelogram-6bar"
[loggers.daq]
[loggers.forces]
[sensors.base_acc]
kind = "accelerometer"
logger = "daq"
channels = { x = "AccX", y = "AccY", z = "AccZ" }
unit = "g"
range = "%s"
position = ["0.20 m", "-0.10 m", "0 m"]
attached_to = "base"
[sensors.futek_1]
kind = "force"
logger = "forces"
channel = "Fz3"
axis = "z"
range = "1112 N"
position = ["0.15 m", "0.10 m", "0 m"]
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with one log."""
    (tmp_path / "r001.csv").write_text(HEADER + "".join(ROWS))
    return tmp_path


def ingested(folder, planned=None, **options):
    """Ingest one run of the folder; the outcomes."""
    planned = planned or PlannedRun("r001", (folder / "r001.csv",))
    return Ingest(folder / "campaign", **options).run(planned)


def test_a_log_becomes_a_run(folder):
    """The numbers to the bit, the source by name, size and digest only, nothing of where it lay."""
    (outcome,) = ingested(folder)
    assert (outcome.status, outcome.file, outcome.origin) == ("stored", "r001.h5", "unstated")
    run = open_run(folder / "campaign" / "r001.h5")
    expected = np.array([[float(c) for c in row.split(",")] for row in ROWS]).T
    for name, column in zip(["Time (s)", "AccX", "AccY", "AccZ"], expected, strict=True):
        assert run.channel(name).tobytes() == column.tobytes()
    (source,) = run.provenance["sources"]
    log = folder / "r001.csv"
    assert source["sha256"] == outcome.sha256 == hashlib.sha256(log.read_bytes()).hexdigest()
    assert (source["name"], source["size_bytes"]) == ("r001.csv", log.stat().st_size)
    assert str(folder).encode() not in run.path.read_bytes()
    assert run.rate_hz == pytest.approx(1000.0)


def test_the_same_log_is_stored_once(folder):
    """Under another name it is still the same recording: reported, and nothing is written or changed."""
    ingested(folder)
    before = {p.name: p.read_bytes() for p in (folder / "campaign").iterdir()}
    os.rename(folder / "r001.csv", folder / "again.csv")
    (outcome,) = ingested(folder, PlannedRun("again", (folder / "again.csv",)))
    assert (outcome.status, outcome.file) == ("already_stored", "r001.h5")
    assert {p.name: p.read_bytes() for p in (folder / "campaign").iterdir()} == before


def test_another_log_of_the_same_name_is_refused(folder):
    """A stored run is never replaced."""
    ingested(folder)
    (folder / "r001.csv").write_text(HEADER + "".join(ROWS[:100]))
    (outcome,) = ingested(folder)
    assert outcome.status == "refused"
    assert "stored runs never change" in outcome.message
    assert open_run(folder / "campaign" / "r001.h5").group().samples == 400


def test_logs_of_one_run_are_groups_of_one_file(folder):
    """Two loggers, two clocks, one run; conditions and origin from the run table."""
    (folder / "r001_forces.csv").write_text(
        "t;Fz3\ns;N\n" + "".join(f"{i / 50:.2f};{i}\n".replace(".", ",") for i in range(99))
    )
    planned = PlannedRun("r001", (folder / "r001.csv", folder / "r001_forces.csv"), "measured", {"payload_kg": 5.0})
    outcomes = ingested(folder, planned)
    assert [(o.status, o.file) for o in outcomes] == [("stored", "r001.h5")] * 2
    (run,) = open_campaign(folder / "campaign").runs
    assert [(g.name, g.samples) for g in run.groups] == [("r001", 400), ("r001_forces", 99)]
    assert (run.origin, run.conditions) == ("measured", {"payload_kg": 5.0})
    assert run.channel("Fz3")[-1] == 98
    assert run.time("r001_forces")[-1] == 1.96


def test_one_bad_log_keeps_the_whole_run_out(folder):
    """A run is stored whole or not at all, and the folder is not even made."""
    (folder / "torn.csv").write_text(HEADER + "".join(ROWS[:50]) + "1,2\n" + "".join(ROWS[50:]))
    outcomes = ingested(folder, PlannedRun("r001", (folder / "r001.csv", folder / "torn.csv")))
    assert [o.status for o in outcomes] == ["refused", "refused"]
    assert [f.code for f in outcomes[1].findings if f.severity == 2] == ["ragged_row"]
    assert not (folder / "campaign").exists()


def test_a_decision_of_a_person_is_stored(folder):
    """What was accepted stands with the run, and the finding with it."""
    (folder / "r001.csv").write_text(HEADER + "".join(ROWS[:50]) + "1,2\n" + "".join(ROWS[50:]))
    person = {"by": "A. Kaya", "reason": "the cable was pulled"}
    (outcome,) = ingested(folder, accepted=frozenset({"ragged_row"}), acceptance=person)
    run = open_run(folder / "campaign" / "r001.h5")
    assert outcome.status == "stored"
    assert run.provenance["accepted_findings"] == ["ragged_row"]
    (entry,) = read_ledger(folder / "campaign").entries
    assert entry.details == {"accepted_findings": ["ragged_row"], "acceptance": person}
    (folder / "whole.csv").write_text(HEADER + "".join(ROWS[:80]))
    ingested(
        folder, PlannedRun("whole", (folder / "whole.csv",)), accepted=frozenset({"ragged_row"}), acceptance=person
    )
    assert read_ledger(folder / "campaign").entries[-1].details == {}, "it has no such finding"
    assert "ragged_row" in {f.code for f in run.findings}
    assert np.isnan(run.channel("AccX")[50])
    assert np.isfinite(np.delete(run.channel("AccX"), 50)).all()


@pytest.mark.parametrize(
    ("comment", "stated", "origin"),
    [("", None, "unstated"), ("", "measured", "measured"), ("# origin: simulated\n", None, "simulated"),
     ("# origin: simulated\n", "unstated", "simulated"), ("# origin: measured\n", None, "unstated")],
)  # fmt: skip
def test_nothing_becomes_measured_by_itself(folder, comment, stated, origin):
    """Simulated if the log says so; measured only if the run table does."""
    (folder / "r001.csv").write_text(comment + HEADER + "".join(ROWS))
    (outcome,) = ingested(folder, PlannedRun("r001", (folder / "r001.csv",), stated, {}))
    assert outcome.origin == open_run(folder / "campaign" / "r001.h5").origin == origin


def test_a_simulated_log_cannot_be_called_measured(folder):
    """The contradiction is refused."""
    (folder / "r001.csv").write_text("# origin: simulated\n" + HEADER + "".join(ROWS))
    (outcome,) = ingested(folder, PlannedRun("r001", (folder / "r001.csv",), "measured", {}))
    assert outcome.status == "refused"
    assert outcome.origin == document(outcome)["origin"] == "simulated"
    assert [f.code for f in outcome.findings] == ["origin_contradiction"]


def test_a_log_that_grows_meanwhile_is_refused(folder):
    """A logger still at work: no half recording is stored as a whole one."""
    log = folder / "r001.csv"

    def grow(_):
        if len(log.read_text().splitlines()) == 1 + len(ROWS):
            with log.open("a") as stream:
                stream.write("0.4000,0.0000,0.0000,0.0000\n")

    (outcome,) = ingested(folder, progress=grow)
    assert outcome.status == "refused"
    assert "changed while it was read" in outcome.message
    assert not (folder / "campaign").exists()


def test_the_rig_is_kept_and_its_ranges_are_used(folder):
    """The rig's text is in the run to the byte; its 12 g range finds what no header states."""
    rig = rigs.load_rig(RIG % "12 g")
    (outcome,) = ingested(folder, rig=rig)
    assert open_run(folder / "campaign" / "r001.h5").rig == RIG % "12 g"
    assert {f.channel for f in outcome.findings if f.code == "clipping"} == {"AccY (g)"}
    assert not [f for f in outcome.findings if f.code == "rig_contradiction"]


@pytest.mark.parametrize(
    ("old", "new", "channel"),
    [("AccZ (g)", "AccQ (g)", "AccZ"), ("AccY (g)", "AccY (m/s^2)", "AccY (m/s^2)"), ("Acc", "Beschl", None)],
)
def test_a_rig_that_does_not_fit_is_refused(folder, old, new, channel):
    """A channel that the log does not hold, a unit that differs, no common channel at all: named and refused."""
    (folder / "r001.csv").write_text(HEADER.replace(old, new) + "".join(ROWS))
    (outcome,) = ingested(folder, rig=rigs.load_rig(RIG % "50 g"))
    assert outcome.status == "refused"
    assert [f.channel for f in outcome.findings if f.code == "rig_contradiction"] == [channel]


def test_a_disk_that_is_full_leaves_the_campaign_intact(folder, monkeypatch):
    """The message is the system's, and no part of the run is left."""
    ingested(folder)
    (folder / "r002.csv").write_text(HEADER + "".join(ROWS[:99]))

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("testbench.store.writer.sync", full)
    (outcome,) = ingested(folder, PlannedRun("r002", (folder / "r002.csv",)))
    assert outcome.status == "refused"
    assert "cannot be written (No space left on device)" in outcome.message
    assert names_in(folder / "campaign") == ["r001.h5", "r001.h5.sha256"]


def test_one_recording_twice_in_one_run(folder):
    """The same bytes under two names are no second logger."""
    (folder / "copy.csv").write_bytes((folder / "r001.csv").read_bytes())
    outcomes = ingested(folder, PlannedRun("r001", (folder / "r001.csv", folder / "copy.csv")))
    assert {o.status for o in outcomes} == {"refused"}
    assert "copy.csv: holds the same bytes as r001.csv" in outcomes[0].message
    assert not (folder / "campaign").exists()


@pytest.mark.parametrize(("rate", "found"), [("1 kHz", 0), ("1.004 kHz", 0), ("2 kHz", 1), ("990 Hz", 1)])
def test_the_rate_of_the_rig_against_that_of_the_log(folder, rate, found):
    """Beyond the tolerance of a printed rate it is said; the log's clock counts."""
    rig = rigs.load_rig((RIG % "50 g").replace("[loggers.daq]", f'[loggers.daq]\nrate = "{rate}"'))
    (outcome,) = ingested(folder, rig=rig)
    assert outcome.status == "stored"
    assert [f.code for f in outcome.findings].count("rate_contradicts_rig") == found
    assert open_run(folder / "campaign" / "r001.h5").rate_hz == pytest.approx(1000.0)


def test_sensors_of_a_logger_that_is_not_in_the_run(folder):
    """The run is stored, and it is said which sensors are not recorded."""
    (outcome,) = ingested(folder, rig=rigs.load_rig(RIG % "50 g"))
    assert outcome.status == "stored"
    (found,) = [f for f in outcome.findings if f.code == "sensor_not_recorded"]
    assert "logger forces" in found.message
    assert "futek_1" in found.message


def test_a_site_that_the_mechanism_does_not_have(folder):
    """A counter-mass on a site that the rig's mechanism does not know keeps the run out, unless a person says so."""
    (folder / "rig.toml").write_text(RIG % "50 g")
    planned = PlannedRun("r001", (folder / "r001.csv",), None, {"counter_masses": {"counter_AOA": 1.0}})
    rig = rigs.load_rig(folder / "rig.toml")
    (outcome,) = ingested(folder, planned, rig=rig)
    assert outcome.status == "refused"
    (found,) = [f for f in outcome.findings if f.code == "unknown_site"]
    assert "no site 'counter_AOA'" in found.message
    assert "did you mean 'counter_A0A'" in found.message
    (outcome,) = ingested(folder, planned, rig=rig, accepted=frozenset({"unknown_site"}))
    assert outcome.status == "stored"


@pytest.mark.parametrize(
    ("log", "now", "told"),
    [
        ("", {"conditions": {"payload_kg": 3.0}}, "payload_kg 5 (now 3)"),
        ("", {"origin": "simulated"}, "origin measured (now simulated)"),
        ("", {"name": "r002"}, "run r001 (now r002)"),
        ("# origin: simulated\n", {"origin": "measured"}, "origin simulated (now measured)"),
        ("# origin: simulated\n", {"origin": "unstated"}, None),
    ],
)
def test_a_row_of_the_run_table_that_was_corrected_too_late(folder, log, now, told):
    """Ingesting again with another cell changes nothing, and says which; what the log itself states is no change."""
    (folder / "r001.csv").write_text(log + HEADER + "".join(ROWS))
    planned = PlannedRun("r001", (folder / "r001.csv",), "simulated" if log else "measured", {"payload_kg": 5.0})
    ingested(folder, planned)
    (outcome,) = ingested(folder, replace(planned, **now))
    assert outcome.status == "already_stored"
    said = [f.message.partition(";")[0] for f in outcome.findings if f.code == "conditions_differ"]
    assert said == [f"r001.h5 is stored with other values than the run table has: {told}"] * (told is not None)
    assert open_run(folder / "campaign" / "r001.h5").conditions == {"payload_kg": 5.0}


@pytest.fixture
def two_logs(folder):
    """A run of two logs, stored."""
    (folder / "more.csv").write_text(HEADER + "".join(ROWS[7:]))
    planned = PlannedRun("r001", (folder / "r001.csv", folder / "more.csv"), "measured", {})
    assert [o.status for o in ingested(folder, planned)] == ["stored"] * 2
    return planned


def test_a_stored_log_that_has_grown(folder, two_logs):
    """Alone it is no longer what was stored, with both digests; with the other log it is stored anew, once."""
    log, before = folder / "r001.csv", hashlib.sha256((folder / "r001.csv").read_bytes()).hexdigest()
    log.write_text(log.read_text() + "0.4000,0,0,0\n")
    alone = replace(two_logs, files=(log,), missing=("more.csv",), problem="waits for more.csv")
    (there, refused) = ingested(folder, alone)
    assert (there.source, there.status, refused.status) == ("more.csv", "already_stored", "refused")
    assert refused.message.startswith("r001.csv is no longer the file of which r001.h5 was made at 2")
    for digest in (before, hashlib.sha256(log.read_bytes()).hexdigest()):
        assert digest[:12] in refused.message
    assert refused.message.endswith("it has grown: give more.csv too, and the run is stored anew as its next version")
    for samples in (401, 402):
        anew = [(o.status, o.file) for o in ingested(folder, two_logs)]
        assert anew == [("stored", f"r001.v{samples - 399}.h5")] * 2
        (newest,) = open_campaign(folder / "campaign").runs
        assert newest.group("r001").samples == samples
        assert {o.status for o in ingested(folder, two_logs)} == {"already_stored"}
        log.write_text(log.read_text() + f"0.{samples},0,0,0\n")


def test_a_run_named_like_a_version(folder):
    """A run table's `r001.v2` is a run of its own: exchanged with r001 it is told of both, and has its own versions."""
    logs = {name: folder / f"{name}.csv" for name in ("r001", "other")}
    logs["other"].write_text(HEADER + "".join(ROWS[3:]))
    for name, log in (("r001", "r001"), ("r001.v2", "other")):
        ingested(folder, PlannedRun(name, (logs[log],)))
    for name, log, stored in (("r001", "other", "r001.v2"), ("r001.v2", "r001", "r001")):
        (outcome,) = ingested(folder, PlannedRun(name, (logs[log],), None, {}))
        (said,) = [f.message for f in outcome.findings if f.code == "conditions_differ"]
        assert said.startswith(
            f"{stored}.h5 is stored with other values than the run table has: run {stored} (now {name})"
        )
    logs["other"].write_text(logs["other"].read_text() + "0.4000,0,0,0\n")
    logs["r001"].write_text(logs["r001"].read_text() + "0.4000,0,0,0\n")
    grown = [
        ingested(folder, PlannedRun(name, (logs[log],)))[0] for name, log in (("r001.v2", "other"), ("r001", "r001"))
    ]
    assert [(one.status, one.file) for one in grown] == [("stored", "r001.v2.v2.h5"), ("stored", "r001.v3.h5")]


@pytest.mark.parametrize("given", [["r001.csv"], ["r001.csv", "more.csv"]])
def test_a_stored_log_that_was_changed(folder, two_logs, given):
    """What does not begin as it was stored is another log: named, and never stored beside it by itself."""
    (folder / "r001.csv").write_text(HEADER + "".join(ROWS[-99:]))
    rest = tuple({"more.csv"} - set(given))
    *_, told = ingested(folder, replace(two_logs, files=tuple(folder / name for name in given), missing=rest))
    assert told.message.startswith("r001.csv is no longer the file of which r001.h5 was made at 2")
    assert told.message.endswith("take it out by testbench remove, with the reason, and ingest again")


def test_a_copy_among_several_logs_of_a_run(folder, two_logs):
    """The log, and the one of the other run that it equals byte for byte, are named; the whole run waits."""
    (folder / "copy.csv").write_bytes((folder / "more.csv").read_bytes())
    (folder / "r002.csv").write_text(HEADER + "".join(ROWS[3:]))
    planned = PlannedRun("r002", (folder / "r002.csv", folder / "copy.csv"), "measured", {})
    outcomes = ingested(folder, planned)
    assert {o.status for o in outcomes} == {"refused"}
    assert outcomes[0].message.startswith("more.csv and copy.csv are one recording (byte for byte), stored as r001.h5")


def test_logs_that_change_runs_in_the_run_table(folder, two_logs):
    """Given, it is said of which run each was; else that a run was made of a log of that name, and not only missing."""
    moved = replace(two_logs, name="r009", files=(), missing=("r001.csv", "more.csv", "new.csv"))
    *logs, new = ingested(folder, moved)
    for log in logs:
        assert log.status == "missing"
        assert "; r001.h5 was made of a log of this name: if it is that one, rows of the run table" in log.message
    assert new.message == "is of run r009 by the run table, and was not given: ingest it when it is there"
    given = ingested(folder, replace(two_logs, name="r009"))
    assert [sum("run r001 (now r009)" in f.message for f in outcome.findings) for outcome in given] == [1, 1]


def test_one_log_under_two_names_of_two_runs(folder):
    """Byte for byte: said of both logs once, and not condition by condition as of a run table that was corrected."""
    (folder / "r002.csv").write_bytes((folder / "r001.csv").read_bytes())
    ingested(folder, PlannedRun("r001", (folder / "r001.csv",), None, {"payload_kg": 5.0, "repeat": 1}))
    (outcome,) = ingested(folder, PlannedRun("r002", (folder / "r002.csv",), None, {"payload_kg": 3.0, "repeat": 2}))
    (said,) = [f.message for f in outcome.findings if f.code == "conditions_differ"]
    assert said.startswith("r001.csv and r002.csv are one recording (byte for byte), stored as r001.h5: bring the")
    (folder / "other.csv").write_text(HEADER + "".join(ROWS[:-1]))
    both = PlannedRun("r003", (folder / "other.csv", folder / "r002.csv"), None, {"payload_kg": 3.0})
    refused = ingested(folder, both)
    assert {one.status for one in refused} == {"refused"}
    assert "r001.csv and r002.csv are one recording (byte for byte), stored as r001.h5" in refused[0].message


def test_a_rig_that_comes_too_late(folder):
    """A run stored without a rig keeps what it has: said, with the way out, and with the origin of what is stored."""
    ingested(folder, PlannedRun("r001", (folder / "r001.csv",), "measured"))
    (folder / "rig.toml").write_text(RIG % "50 g")
    (outcome,) = ingested(folder, PlannedRun("r001", (folder / "r001.csv",)), rig=rigs.load_rig(folder / "rig.toml"))
    assert (outcome.status, outcome.origin) == ("already_stored", "measured")
    (found,) = [f for f in outcome.findings if f.code == "rig_differs"]
    assert "stored without a rig" in found.message
    assert "another folder" in found.message


@pytest.mark.parametrize("damage", ["cut", "no HDF5", "empty", "description"])
def test_a_damaged_run_keeps_no_other_out(folder, damage):
    """What comes is stored, and names the run that may hold the same; the name of the damaged one stays taken."""
    ingested(folder)
    damaged = folder / "campaign" / "r001.h5"
    content = damaged.read_bytes()
    at = content.index(b'"conditions"')
    damaged.write_bytes({
        "cut": content[:5000], "no HDF5": b"x" * 5000, "empty": b"",
        "description": content[:at] + b"#" + content[at + 1 :],
    }[damage])  # fmt: skip
    before = {name: (folder / "campaign" / name).read_bytes() for name in names_in(folder / "campaign")}
    (folder / "r002.csv").write_text(HEADER + "".join(ROWS[:300]))
    work = Ingest(folder / "campaign")
    (outcome,) = work.run(PlannedRun("r002", (folder / "r002.csv",)))
    assert (outcome.status, outcome.file) == ("stored", "r002.h5")
    stored = open_run(folder / "campaign" / "r002.h5")
    (found,) = [f for f in stored.findings if f.code == "run_not_opened"]
    assert found.message.startswith("r001.h5 of the campaign cannot be opened")
    assert "testbench verify" in found.message
    assert str(folder) not in found.message
    (again,) = work.run(PlannedRun("r001", (folder / "r001.csv",)))
    assert (again.status, again.file) == ("refused", None)
    assert "r001.h5 of the campaign cannot be opened" in again.message
    assert "then `testbench remove` takes it out of the campaign" in again.message
    (once,) = work.run(PlannedRun("r002_again", (folder / "r002.csv",)))
    assert once.status == "already_stored"
    assert {name: (folder / "campaign" / name).read_bytes() for name in before} == before
    for left in ("r001.h5", "r001.h5.sha256"):
        (folder / "campaign" / left).unlink()
    (whole,) = work.run(PlannedRun("r001", (folder / "r001.csv",)))
    assert whole.status == "stored"
    assert "run_not_opened" not in {f.code for f in whole.findings}


def test_channels_without_end_are_refused(folder, monkeypatch):
    """Named in the header, or by headers that come again and again: refused with their number."""
    monkeypatch.setattr("testbench.ingestion.log_sources.MOST_CHANNELS", 30)
    wide, again = folder / "wide.csv", folder / "again.csv"
    wide.write_text(",".join(f"c{i}" for i in range(31)) + "\n" + (",".join("1" * 31) + "\n") * 3)
    again.write_text((HEADER + "".join(ROWS[:20])) * 8)
    for path, count in ((wide, 31), (again, 32)):
        (outcome,) = ingested(folder, PlannedRun(path.stem, (path,)))
        assert outcome.message == f"{path.name}: {count} channels; expected no more than 30: export fewer at a time"
        assert [f.code for f in outcome.findings if f.severity == 2] == ["too_large"]
    assert not (folder / "campaign").exists()
