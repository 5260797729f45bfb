"""``testbench align`` and ``testbench trim`` as a person calls them."""

import errno
import os
import shutil

import pytest
from click.testing import CliRunner

from balance.datasets import find_dataset
from testbench.cli.align import align
from testbench.cli.trim import trim
from testbench.cross_examination import Examination, Statement
from testbench.errors import AnalysisError, StoreError
from testbench.store import append_only_records

from ...commands import invoke

STARTS = {"daq": -0.237, "forces": -0.151, "controller": -0.100}
"""Of the loggers in the shipped rig, from the start of the motion [s]."""


@pytest.fixture(scope="module")
def campaign(pair_built):
    """A campaign of two runs with the counter-masses that were built for 3.4116 kg."""
    return pair_built.campaign


@pytest.fixture(scope="module")
def aligned(campaign, tmp_path_factory):
    """The same whose clocks were aligned, and what that said."""
    folder = shutil.copytree(campaign, tmp_path_factory.mktemp("aligned") / "campaign")
    return folder, invoke(align, folder, "--no-drift", "--json").json


@pytest.fixture(scope="module")
def trimmed(campaign):
    """The document of ``trim``, MECH as it is stored with the runs."""
    return invoke(trim, campaign, "--json", "--budget").json


def test_align_stores_a_record(campaign, aligned):
    """Offsets are those of the bench, within their intervals' size; a dry run leaves no record, another leaves one."""
    folder, found = aligned
    dry = invoke(align, campaign / "r001.h5", "--dry-run", "--json").json
    assert not dry["records"]
    assert not append_only_records.read_records(campaign)
    assert len(found["alignments"]) == 4
    for row in found["alignments"]:
        true = STARTS[row["group"].partition("_")[2]] - STARTS["controller"]
        assert row["offset_s"] == pytest.approx(true, abs=max(2e-4, 2.0 * row["uncertainty_s"]))
        assert row["offset_interval_s"][0] < row["offset_s"] < row["offset_interval_s"][1]
        assert row["origin"] == "simulated"
    (stored,) = append_only_records.read_records(folder, "alignment")
    assert stored.content["alignments"] == found["alignments"]
    assert set(stored.runs) == {"r001.h5", "r002.h5"}


def test_align_of_a_campaign_that_is_read_only(campaign, monkeypatch):
    """Refused before anything is computed, with the way out; a dry run takes it."""
    monkeypatch.setattr(append_only_records.os, "access", lambda path, mode, **_: mode != os.W_OK)
    computed = []
    monkeypatch.setattr("testbench.synchronization.run_alignment.align_run", lambda *words: computed.append(words))
    with pytest.raises(
        StoreError, match=r"cannot be written, so nothing can be recorded .*, or print the result only: --dry-run"
    ):
        invoke(align, campaign)
    assert not computed


def test_align_that_cannot_be_recorded(campaign, tmp_path, monkeypatch):
    """What was computed is shown all the same, with why it is not recorded, and nothing half is left."""

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    folder = shutil.copytree(campaign, tmp_path / "campaign")
    monkeypatch.setattr(append_only_records.os, "fsync", full)
    found = invoke(align, folder / "r001.h5", "--no-drift", "--json", code=1).json
    assert len(found["alignments"]) == 2
    assert not found["records"]
    assert "cannot be written (No space left on device); nothing was recorded" in found["refused"][0]
    assert not list((folder / "records").iterdir())


def test_align_for_people(campaign):
    """The table says against which clock, within what, by what, and that the runs are simulated."""
    text = invoke(align, campaign / "r001.h5", "--no-drift", "--dry-run").out
    for words in ("against r001_controller", "within [ms]", "base motion taken", "simulated"):
        assert words in text


def test_align_names_the_triggers_of_a_rig(campaign, tmp_path):
    """By signals, the better way is named; where only one logger has a trigger there is none."""
    text, rig = find_dataset("parallelogram-6bar", "rigs", ".toml").read_text("utf-8"), tmp_path / "rig.toml"
    shown = []
    for logger, channel in (("controller", "TargetY"), ("daq", "PlatY")):
        assert f', y = "{channel}"' in text
        text = text.replace(f', y = "{channel}"', "")
        text += f'\n[sensors.trigger_{logger}]\nkind = "trigger"\nlogger = "{logger}"\nchannel = "{channel}"\n'
        rig.write_text(text, "utf-8")
        shown.append(invoke(align, campaign / "r001.h5", "--no-drift", "--dry-run", "--rig", rig).out)
    assert "--by trigger" not in shown[0]
    assert "--by trigger aligns the clocks by its edges" in shown[1]


def test_align_by_named_channels_can_be_refused(campaign):
    """Channels that saw nothing in common: said why, exit code 1."""
    done = CliRunner().invoke(align, [str(campaign / "r001.h5"), "--pair", "TargetX=Fz3", "--json"])
    assert "common content" in done.output or "ambiguous" in done.output
    assert CliRunner().invoke(align, [str(campaign), "--by", "nothing"]).exit_code == 2


def test_trim_document(trimmed):
    """Keys of the JSON document; 0.0308 kg m and 0.82 kg an arm within the intervals; simulated is said."""
    found = trimmed
    assert {"missing", "add", "predicted_residual_kgm", "verdict"} <= set(found)
    assert found["verdict"] == "add"
    assert found["origin"] == "simulated"
    for missing, added in zip(found["missing"], found["add"], strict=True):
        low, high = missing["interval"]
        assert low < 0.030809 < high
        assert added["site"] == missing["site"]
        assert low / 0.03755 < added["mass_kg"] < high / 0.03755
    assert found["predicted_residual_kgm"] < 0.005
    for missing, budget in zip(found["missing"], found["budget"], strict=True):
        low, high = missing["interval"]
        assert budget["expanded_uncertainty"] == pytest.approx(0.5 * (high - low))


def test_trim_gives_what_is_accepted_on_record(campaign, monkeypatch):
    """Not on this command line alone: a contradiction that was accepted in the campaign stays with the numbers."""
    stated = Statement("r002", "payload", None, "8 kg", "5 kg", "the drives", "payload_contradiction")
    found = Examination(("r002",), (stated,), {}, accepted=frozenset({"payload_contradiction"}))
    monkeypatch.setattr("testbench.cross_examination.examine", lambda *_: found)
    document = invoke(trim, campaign, "--by", "wrench", "--json", code=3).json
    assert [one["code"] for one in document["accepted"]] == ["payload_contradiction"]
    assert document["verdict"] == "add"


def test_a_doubtful_trim_says_what_to_do(campaign, monkeypatch):
    """A contradiction that nobody accepted: the line of the verdict has what to do before masses are mounted."""
    stated = Statement("r002", "payload", None, "8 kg", "5 kg", "the drives", "payload_contradiction")
    monkeypatch.setattr("testbench.cross_examination.examine", lambda *_: Examination(("r002",), (stated,), {}))
    first = " ".join(invoke(trim, campaign, "--by", "wrench", code=3).out.split("\n\n")[0].split())
    said = "Doubtful (testbench doctor CAMPAIGN RUN names a contradiction): mount nothing yet. Estimate: Missing "
    assert first.startswith(said)
    assert "Add" not in first


def test_trim_for_people(aligned, tmp_path):
    """The text says what to add where, how it was found, and that the runs are simulated; plates are named."""
    shelf = tmp_path / "shelf.csv"
    shelf.write_text("name,mass_kg,quantity\nP400,0.4,6\n", encoding="utf-8")
    text = invoke(trim, "parallelogram-6bar", aligned[0], "--stock", shelf, "--all").out
    for words in ("Add 0.800 kg at counter_A0A = 2 P400", "base's motion taken out", "simulated", "Verdict: add"):
        assert words in text


def test_plates_that_are_too_heavy(aligned, tmp_path):
    """Said as such beside the verdict, not as if nothing were missing; each line says which source it is of."""
    shelf = tmp_path / "shelf.csv"
    shelf.write_text("name,mass_kg,quantity\nP5,5.0,4\n", encoding="utf-8")
    text = invoke(trim, "parallelogram-6bar", aligned[0], "--stock", shelf, "--all").out
    assert "bring it nearer: what is missing stays: 0.8" in text
    assert f"Verdict: add, but not from {shelf}" in text
    assert "Nothing to add" not in text
    assert "By motor torques: intervals: delete-block jackknife" in text


def test_a_trim_that_too_few_sites_allow_says_so(aligned):
    """Without --all: its masses are not those of `balance size` for one motion."""
    said = " ".join(invoke(trim, "parallelogram-6bar", aligned[0], "--site", "counter_A0A").out.split())
    assert "No masses at these sites meet all conditions: of an open chain what is missing" in said


def test_trim_of_two_mountings_that_nobody_meant_for_trials(campaign, brief):
    """Runs with and without counter-masses: said why they are taken for trials, and what else can be asked."""
    runs = [brief.campaign / f"r00{k}.h5" for k in (5, 6)]
    with pytest.raises(
        AnalysisError, match=r"what is mounted differs from run to run.* name runs of one mounting alone"
    ):
        invoke(trim, "parallelogram-6bar", *runs)


def test_trim_uses_what_align_stored(trimmed, aligned, monkeypatch):
    """With a stored alignment no clock is aligned anew, and the answer is the same to a tenth of its interval."""
    monkeypatch.setattr("testbench.synchronization.run_alignment.align_run", None)
    after = invoke(trim, "parallelogram-6bar", aligned[0], "--json").json
    for one, other in zip(trimmed["missing"], after["missing"], strict=True):
        width = one["interval"][1] - one["interval"][0]
        assert other["first_moment_kgm"] == pytest.approx(one["first_moment_kgm"], abs=0.1 * width)


def test_trim_refuses_an_unknown_site(campaign):
    """A site that the mechanism does not have is refused by name."""
    with pytest.raises(Exception, match="no site 'elbow'"):
        invoke(trim, "parallelogram-6bar", campaign, "--site", "elbow")


def test_trim_refuses_what_cannot_tell(campaign):
    """Runs of another mechanism are refused: this one carries no payload."""
    with pytest.raises(AnalysisError, match="payload"):
        invoke(trim, "serial-2r", campaign / "r001.h5", "--by", "torque")
