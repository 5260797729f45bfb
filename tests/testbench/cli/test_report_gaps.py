"""``testbench report`` of a run whose encoders' log has a gap: all parts are told, less what the gap touches."""

import pytest

from testbench.cli.report import report

from ...commands import invoke
from .gapped import without_rows


@pytest.fixture(scope="module")
def gapped(brief, tmp_path_factory):
    """The brief campaign, a tenth of a second of the motion of r001 lost, another of the rest before that of r003."""
    cuts = {"r001_controller.csv": (0.3, 0.4), "r003_controller.csv": (0.05, 0.15)}
    return without_rows(brief, tmp_path_factory.mktemp("gapped"), cuts)


def told(run, expected) -> dict:
    """The document of the command for one run."""
    (found,) = invoke(report, run, "--json", code=expected).json["runs"]
    return found


def test_the_rest_of_the_run_is_told(brief, gapped):
    """Torques and command as in the whole run; the motion of which a part is lost is unknown, and it is a finding."""
    whole, found = told(brief.campaign / "r001.h5", 0), told(gapped / "r001.h5", 3)
    assert [f["code"] for f in found["findings"]] == ["time_gap"]
    assert (
        "0.101 s in all, the first after 0.299 s: left out, with 0.025 s about each" in found["findings"][0]["message"]
    )
    for one, other in zip(found["torque"]["drives"], whole["torque"]["drives"], strict=True):
        assert one["scale"] == pytest.approx(other["scale"], abs=0.01)
        assert one["residual_share"] == pytest.approx(other["residual_share"], rel=0.2)
        assert one["left_out_s"] == pytest.approx(0.15, abs=2e-3)
        assert one["delay_s"] == pytest.approx(other["delay_s"], abs=1e-4)
    for one, other in zip(found["command"]["axes"], whole["command"]["axes"], strict=True):
        assert one["error_rms_m_s2"] == pytest.approx(other["error_rms_m_s2"], rel=0.2)
        assert one["peak_m_s2"] == pytest.approx(other["peak_m_s2"], rel=0.05)
    shifts = [r["command"]["accelerometer_shifted_s"] for r in (found, whole)]
    assert shifts[0] == pytest.approx(shifts[1], abs=2e-4)
    by = {m["by"]: m for m in found["motions"]["found"]}
    assert by["acceleration"]["motion"] == "x"
    assert [by[source]["motion"] for source in ("command", "encoders")] == ["unknown", "unknown"]
    assert by["encoders"]["reason"] == "a gap of 0.101 s after 0.299 s touches it"
    assert by["command"]["extent_m"] is None


def test_a_gap_at_rest_touches_no_motion(gapped):
    """The encoders name the motion as ever, for they stand before and after the gap where they stood."""
    found = told(gapped / "r003.h5", 3)
    by = {m["by"]: m["motion"] for m in found["motions"]["found"]}
    assert by["encoders"] == "y"
    assert by["command"] == "unknown"
    assert [f["code"] for f in found["findings"]] == ["time_gap"]


def test_torques_of_unequal_spans_are_not_compared(gapped):
    """A run with a gap has no part in the torques with and without counter-masses; whole runs have."""
    found = invoke(report, gapped, "--json", code=3).json
    compared = {tuple(c["runs"]): c["torques"] for c in found["compared"]}
    assert {runs for runs, torques in compared.items() if not torques} == {("r001", "r002"), ("r003", "r004")}
    assert {runs for runs, torques in compared.items() if torques} == {("r005", "r006"), ("r007", "r008")}


def test_text_says_what_is_left_out(gapped):
    """For people: the finding below the table."""
    said = invoke(report, gapped / "r001.h5", code=3).out
    assert "time_gap: r001: 1 gap in the record of r001_controller" in said
    assert "No torque" not in said
