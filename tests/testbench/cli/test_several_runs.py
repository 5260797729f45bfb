"""Commands that do each run by itself: one that cannot be opened is named, exit code 1, and keeps no other out."""

import shutil

import pytest

from testbench.cli.align import align
from testbench.cli.campaign import archive, export
from testbench.cli.campaign import list_runs as listing
from testbench.cli.report import report
from testbench.store import open_run

from ...commands import invoke


@pytest.fixture
def campaign(brief, tmp_path):
    """Three runs of the brief campaign, the second one overwritten by something else."""
    folder = tmp_path / "campaign"
    folder.mkdir()
    for name in ("r001", "r002", "r003"):
        shutil.copy(brief.campaign / f"{name}.h5", folder)
        shutil.copy(brief.campaign / f"{name}.h5.sha256", folder)
    (folder / "r002.h5").write_text("not a run")
    return folder


def refused(command, *words):
    """The document, and what is said beside it, of a call in which some run was refused."""
    done = invoke(command, *words, "--json", code=1)
    return done.json, done.err


def test_archive(campaign, tmp_path):
    """The file that is not there comes first; the two that can be are archived, to the bit."""
    found, _ = refused(archive, campaign / "nope.h5", campaign, "-o", tmp_path / "archive")
    assert [(run["run"], run["status"]) for run in found["runs"]] == [
        ("r001", "archived"), ("r003", "archived"), ("nope", "refused"), ("r002", "refused"),
    ]  # fmt: skip
    for name in ("r001", "r003"):
        before, after = (open_run(folder / f"{name}.h5") for folder in (campaign, tmp_path / "archive"))
        assert before.channel("AccX").tobytes() == after.channel("AccX").tobytes()
    said = invoke(archive, campaign / "nope.h5", "-o", tmp_path / "a", code=1)
    assert (said.out, "no such file" in said.err) == ("", True)


def test_export(campaign, tmp_path):
    """The tables of the two that can be opened, and the reason for the third."""
    found, err = refused(export, campaign, "--to", "csv", "-o", tmp_path / "tables")
    assert [one["run"] for one in found["refused"]] == ["r002"]
    assert len(found["files"]) == 6
    assert "r002.h5" in err
    again, _ = refused(export, campaign, "--to", "csv", "-o", tmp_path / "tables")
    assert [one["run"] for one in again["refused"]] == ["r002", "r001", "r003"], "each says that its file is there"


def test_list(campaign):
    """The two with their conditions, the third with its reason."""
    found, err = refused(listing, campaign)
    assert [run.get("status") for run in found["runs"]] == [None, None, "refused"]
    assert "r002.h5" in err


def test_report(campaign, tmp_path):
    """What can be reported is."""
    found, _ = refused(report, campaign / "nope.h5", campaign / "r001.h5")
    assert len(found["runs"]) == 1
    assert [one["run"] for one in found["refused"]] == ["nope"]
    refused(report, campaign / "nope.h5", "-o", tmp_path / "figures")
    assert not (tmp_path / "figures").exists()


def test_align(campaign):
    """The clocks of the run that is there are aligned."""
    found, _ = refused(align, campaign / "nope.h5", campaign / "r001.h5", "--dry-run")
    assert found["alignments"]
    assert invoke(align, campaign / "r001.h5", "--dry-run").out.startswith("Clocks: 2 aligned, 0 not.")
    assert "no such file" in found["refused"][0]


def test_the_folder_that_one_stands_in(campaign, monkeypatch):
    """A campaign called `.` has its folder's name in what is printed."""
    monkeypatch.chdir(campaign)
    assert refused(listing, ".")[0]["campaign"] == campaign.name
