"""Logs of one run: their digests, and groups that are called alike."""

from pathlib import Path

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from testbench.ingestion import Ingest
from testbench.ingestion.log_sources import Source, distinct_groups
from testbench.ingestion.planned_runs import PlannedRun
from testbench.readers.csv import text_blocks
from testbench.recording import Block, Channel, Group, Recording, UniformClock
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
    source = Source(path, None)
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
