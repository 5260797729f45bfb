"""Channels of text beside the numbers: kept by the samples where they change, in runs, archives, exports."""

import itertools
import json

import pytest

from testbench import recording
from testbench.export import export
from testbench.ingestion.ingest import Ingest
from testbench.ingestion.planned_runs import PlannedRun
from testbench.readers.csv import text_blocks
from testbench.store import open_run
from testbench.store.archive import archive

from . import reading

STATES = ["stop", "run µ", "LOST COMMUNICATION", "x" * 70 + "a", "x" * 70 + "b", "", "stop"]


def each_sample(series, count):
    """The text of every sample."""
    found, texts = dict(zip(series.samples, series.texts, strict=True)), []
    for i in range(count):
        texts.append(found.get(i, texts[-1] if texts else ""))
    return texts


def text_of(states, quote="", count=3):
    """A log in which each of the states stands for some rows."""
    rows = [f"{quote}{state}{quote}" for state in states for _ in range(count)]
    return "t (s),State,F (N)\n" + "".join(f"{i / 100:.2f},{state},{i % 5}.5\n" for i, state in enumerate(rows))


@pytest.mark.parametrize("block", [8 << 20, 100, 31])
@pytest.mark.parametrize("quote", ["", '"'])
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
def test_each_row_keeps_its_text(tmp_path, monkeypatch, block, quote, encoding):
    """However the file is cut into blocks, in whatever encoding, in quotes or not, beside all numbers."""
    monkeypatch.setattr(text_blocks, "BLOCK_BYTES", block)
    path = tmp_path / "log.csv"
    path.write_bytes(text_of(STATES, quote).encode(encoding))
    found = reading.read(path)
    (series,) = found.recording.texts.kept
    assert (series.group, series.channel) == ("log", "State")
    assert each_sample(series, 21) == [state for state in STATES for _ in range(3)]
    assert len(found.column("F (N)")) == 21
    assert "text_kept" in found.codes


def test_texts_without_end_are_given_up(tmp_path, monkeypatch):
    """Where they would fill the memory the channel is left out, and said to be; others are kept."""
    monkeypatch.setattr(recording, "_MOST_TEXT", 3000)
    path = tmp_path / "log.csv"
    rows = (f"{i / 100:.2f},note {i} of a very long log,{'on' if i < 50 else 'off'},{i}.5\n" for i in range(200))
    path.write_text("t (s),Note,State,F (N)\n" + "".join(rows))
    found = reading.read(path)
    assert [series.channel for series in found.recording.texts.kept] == ["State"]
    assert "more than 3000 letters" in found.message("text_channel")
    said = {finding.channel: (finding.code, finding.where) for finding in found.findings if "text" in finding.code}
    assert said == {"Note": ("text_channel", None), "State": ("text_kept", "sample 0")}
    assert len(found.column("F (N)")) == 200


def test_texts_go_where_the_run_goes(tmp_path, command):
    """In the run, also where two logs share a group's name, in archive and export; ``info`` shows them."""
    for folder, states in (("a", STATES), ("b", [f"event {i}" for i in range(9000)])):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "log.csv").write_text(text_of(states, count=1), encoding="utf-8")
    logs = tuple(tmp_path / folder / "log.csv" for folder in "ab")
    (outcome, _) = Ingest(tmp_path / "c").run(PlannedRun("r", logs))
    assert outcome.status == "stored"
    run = open_run(tmp_path / "c" / "r.h5")
    assert [series.group for series in run.texts] == [group.name for group in run.groups]
    assert run.texts[0].texts == STATES
    assert run.texts[1].texts[8999] == "event 8999"
    archive(run, tmp_path / "archive")
    assert open_run(tmp_path / "archive" / "r.h5").texts == run.texts
    first = export(run, "csv", tmp_path / "tables")[0].file.read_text(encoding="utf-8")
    line = next(line for line in itertools.takewhile(lambda x: x[0] == "#", first.splitlines()) if "provenance" in line)
    assert json.loads(line.partition(" = ")[2])["sources"][0]["texts"][0]["texts"] == STATES
    assert "State: text, begins or changes at 7 samples" in command("info", logs[0])[1]
    assert json.loads(command("info", logs[0], "--json")[1])["texts"][0]["samples"] == list(range(7))
